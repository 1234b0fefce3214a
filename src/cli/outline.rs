//! What a scene's file holds by name, for people.

use std::fmt::Write as _;

use crate::scene::gltf::{AnimationOutline, Outline, SkinOutline};
use crate::source::words::{counted, on_one_line};

/// The most lines of nodes, and the most names of other lists, that are shown.
const MOST_NODES: usize = 200;
const MOST_NAMES: usize = 40;

/// The deepest indentation, in levels.
const DEEPEST: usize = 24;

/// The outline as lines of text. Of a huge file it shows the beginning, and the numbers of all.
pub fn text(outline: &Outline) -> String {
    let mut text = String::new();
    let scene = |(index, scene): (usize, &crate::scene::gltf::SceneOutline)| {
        let is_default = outline.default_scene == Some(index as u32) && outline.scenes.len() > 1;
        let default = if is_default { " (the default)" } else { "" };
        format!("{}{default}", element(index, scene.name.as_deref()))
    };
    list(&mut text, "scenes", outline.scenes.iter().enumerate().map(scene));
    let name = |(index, name): (usize, &Option<String>)| element(index, name.as_deref());
    list(&mut text, "materials", outline.materials.iter().enumerate().map(name));
    let camera = |(index, camera): (usize, &crate::scene::gltf::CameraOutline)| {
        let kind = camera.kind.as_deref().map_or(String::new(), |kind| format!(", {}", on_one_line(kind)));
        format!("{}{kind}", element(index, camera.name.as_deref()))
    };
    list(&mut text, "cameras", outline.cameras.iter().enumerate().map(camera));
    let animation = |(index, animation): (usize, &AnimationOutline)| {
        let length = animation.length_s.map_or(String::new(), |length| format!("{length} s, "));
        let nodes = counted(animation.nodes.len(), "node");
        format!("{} ({length}{nodes})", element(index, animation.name.as_deref()))
    };
    list(&mut text, "animations", outline.animations.iter().enumerate().map(animation));
    let skin = |(index, skin): (usize, &SkinOutline)| {
        format!("{} ({})", element(index, skin.name.as_deref()), counted(skin.joints.len(), "joint"))
    };
    list(&mut text, "skins", outline.skins.iter().enumerate().map(skin));
    write_nodes(&mut text, outline);
    text
}

/// `3 "wall"`, or `3` without a name.
fn element(index: usize, name: Option<&str>) -> String {
    match name {
        Some(name) if !name.is_empty() => format!("{index} \"{}\"", on_one_line(name)),
        _ => index.to_string(),
    }
}

fn list(text: &mut String, name: &str, elements: impl ExactSizeIterator<Item = String>) {
    let count = elements.len();
    if count == 0 {
        return;
    }
    let shown: Vec<String> = elements.take(MOST_NAMES).collect();
    let more = if count > MOST_NAMES { format!(", … ({count} in all)") } else { String::new() };
    let _ = writeln!(text, "    {name:<14}{}{more}", shown.join(", "));
}

/// The nodes as a tree, each on a line.
fn write_nodes(text: &mut String, outline: &Outline) {
    let count = outline.nodes.len();
    let _ = writeln!(text, "    {:<14}{count}", "nodes");
    let mut stack: Vec<(u32, usize)> = outline.roots().into_iter().rev().map(|root| (root, 0)).collect();
    // A file that is wrong may have a node twice, or in a circle. Each is shown once.
    let mut is_shown = vec![false; count];
    let mut lines = 0;
    while let Some((index, depth)) = stack.pop() {
        let Some(node) = outline.nodes.get(index as usize) else { continue };
        if std::mem::replace(&mut is_shown[index as usize], true) {
            continue;
        }
        if lines == MOST_NODES {
            let _ = writeln!(text, "      … and {} more: --json lists all", count - lines);
            return;
        }
        lines += 1;
        let indent = "  ".repeat(depth.min(DEEPEST));
        let _ = write!(text, "      {indent}{}", element(index as usize, node.name.as_deref()));
        if let Some(mesh) = node.mesh {
            let name = outline.meshes.get(mesh as usize).and_then(|mesh| mesh.name.as_deref());
            let _ = write!(text, ": mesh {}", element(mesh as usize, name));
        }
        if let Some(camera) = node.camera {
            let name = outline.cameras.get(camera as usize).and_then(|camera| camera.name.as_deref());
            let _ = write!(text, ": camera {}", element(camera as usize, name));
        }
        text.push('\n');
        stack.extend(node.children.iter().rev().map(|&child| (child, depth + 1)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::gltf::NodeOutline;

    fn node(name: &str, children: Vec<u32>) -> NodeOutline {
        NodeOutline { name: Some(name.to_owned()), children, mesh: None, camera: None }
    }

    fn outline(nodes: Vec<NodeOutline>) -> Outline {
        let (scenes, meshes, cameras) = (vec![], vec![], vec![]);
        let (materials, animations, skins) = (vec![], vec![], vec![]);
        Outline { default_scene: None, scenes, nodes, meshes, materials, cameras, animations, skins }
    }

    #[test]
    fn nodes_are_a_tree() {
        let nodes = vec![node("leaf", vec![]), node("root", vec![2, 0]), node("mid\n", vec![])];
        assert_eq!(
            text(&outline(nodes)),
            "    nodes         3\n      1 \"root\"\n        2 \"mid\\n\"\n        0 \"leaf\"\n"
        );
    }

    #[test]
    fn a_huge_file_is_shown_in_part() {
        let mut nodes: Vec<_> = (1..100_000).map(|child| node("n", vec![child])).collect();
        nodes.push(node("last", vec![0, 7]));
        let all = text(&outline(nodes));
        assert!(all.lines().count() <= MOST_NODES + 2 && all.len() < 40_000, "{}", all.len());
        let mut wide = outline(vec![]);
        wide.materials = vec![Some("m".to_owned()); 100_000];
        assert!(text(&wide).contains("… (100000 in all)"));
    }
}
