//! Files that violate glTF and leave no doubt where the geometry is: they are read, with a warning that names the place.
//! A test that is about a case names it.

use super::*;
use crate::source::Severity;

/// The warnings about a file, which must load.
fn warnings(asset: &Asset) -> Vec<String> {
    warned(&asset.load())
}

fn warned(loaded: &Loaded) -> Vec<String> {
    let warnings = loaded.notices.iter().filter(|notice| notice.severity == Severity::Warning);
    warnings.map(ToString::to_string).collect()
}

fn notes(asset: &Asset) -> Vec<String> {
    let loaded = asset.load();
    let notes = loaded.notices.iter().filter(|notice| notice.severity == Severity::Note);
    notes.map(ToString::to_string).collect()
}

fn glb(json: &[u8], binary: &[u8]) -> Vec<u8> {
    let mut file = b"glTF\x02\0\0\0".to_vec();
    file.extend((28 + json.len() as u32 + binary.len() as u32).to_le_bytes());
    for (kind, content) in [(b"JSON", json), (b"BIN\0", binary)] {
        file.extend((content.len() as u32).to_le_bytes());
        file.extend(kind);
        file.extend(content);
    }
    file
}

// ---- Scenes and nodes ----

#[test]
fn a_root_with_a_parent_outside_the_scene_is_where_it_says_itself() {
    // The case root_with_parent.
    let mut asset = Asset::triangle();
    asset.json["nodes"] = json!([
        { "name": "tmpParent", "children": [1], "translation": [100, 0, 0] },
        { "name": "wall", "mesh": 0, "translation": [5, 0, 0], "children": [2] },
        { "mesh": 0, "translation": [0, 1, 0] },
    ]);
    asset.json["scenes"] = json!([{ "name": "Scene", "nodes": [1] }]);
    let loaded = asset.load();
    close(&world(&loaded), &[unit_at(5.0, 0.0, 0.0), unit_at(5.0, 1.0, 0.0)], 0.0);
    assert_eq!(
        warned(&loaded),
        [
            "scene 0 \"Scene\", node 1 \"wall\": it is listed among the scene's nodes, but has a parent, which the \
             scene leaves out: the parent does not move it"
        ]
    );
}

#[test]
fn nodes_that_are_all_listed_as_roots_are_placed_once_each_by_their_parents() {
    // The case all_nodes_as_roots.
    let mut asset = Asset::triangle();
    asset.json["nodes"] = json!([
        { "name": "wall", "mesh": 0 },
        { "name": "grp", "children": [0, 2], "translation": [1, 0, 0] },
        { "mesh": 0, "translation": [5, 0, 0] },
        { "name": "top", "children": [1], "translation": [0, 0, 7] },
    ]);
    for roots in [json!([0, 1, 2, 3]), json!([3, 2, 1, 0]), json!([3, 0]), json!([3, 3])] {
        asset.json["scenes"] = json!([{ "nodes": roots }]);
        let loaded = asset.load();
        close(&world(&loaded), &[unit_at(1.0, 0.0, 7.0), unit_at(6.0, 0.0, 7.0)], 0.0);
        assert_eq!(warned(&loaded).len(), 1, "{roots}: {:?}", warned(&loaded));
    }
    asset.json["scenes"] = json!([{ "nodes": [0, 1, 2, 3] }]);
    assert_eq!(
        warnings(&asset),
        [
            "scene 0, node 0 \"wall\" and 2 others (scene 0, node 1 \"grp\", scene 0, node 2): it is listed among the \
             scene's nodes, but has a parent there, which places it"
        ]
    );
}

#[test]
fn skins_follow_the_roots_of_the_scene() {
    let mut asset = Asset::triangle();
    let joints = asset.accessor("VEC4", UBYTE, 3, &[0; 12]);
    let weights = asset.floats("VEC4", &[[1.0, 0.0, 0.0, 0.0]; 3]);
    asset.json["meshes"][0]["primitives"][0]["attributes"]["JOINTS_0"] = json!(joints);
    asset.json["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = json!(weights);
    asset.json["skins"] = json!([{ "joints": [2] }]);
    asset.json["nodes"] = json!([
        { "children": [1], "translation": [100, 0, 0] },
        { "children": [2, 3], "translation": [0, 10, 0] },
        { "translation": [0, 0, 1] },
        { "mesh": 0, "skin": 0 },
    ]);
    asset.json["scenes"] = json!([{ "nodes": [1] }]);
    close(&world(&asset.load()), &[unit_at(0.0, 10.0, 1.0)], 0.0);
}

#[test]
fn a_default_scene_that_does_not_exist_is_the_first() {
    let mut asset = Asset::triangle();
    asset.json["scene"] = json!(3);
    assert_eq!(
        warnings(&asset),
        ["scene 3: the file's default scene does not exist; all of its nodes are read"]
    );
    asset.json["scenes"] = json!([{ "nodes": [0] }]);
    assert_eq!(
        warnings(&asset),
        ["scene 3: the file's default scene does not exist; its first scene is read"]
    );
}

#[test]
fn a_child_that_is_listed_twice_is_placed_once() {
    let mut asset = Asset::triangle();
    asset.json["nodes"] = json!([{ "name": "Car", "children": [1, 1] }, { "mesh": 0 }]);
    let loaded = asset.load();
    close(&world(&loaded), &[UNIT], 0.0);
    assert_eq!(warned(&loaded), ["node 0 \"Car\": a child is listed twice; it is placed once"]);
}

#[test]
fn the_last_row_of_a_matrix_may_be_rounded() {
    // The case matrix_m44.
    let mut asset = Asset::triangle();
    let mut matrix = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 1.0];
    for (at, value) in [(15, 0.999_999_9), (15, 1.000_000_2), (3, 1e-9), (11, -3e-8)] {
        let right = std::mem::replace(&mut matrix[at], value);
        asset.json["nodes"][0]["matrix"] = json!(matrix);
        let loaded = asset.load();
        close(&world(&loaded), &[unit_at(1.0, 0.0, 0.0)], 0.0);
        assert_eq!(
            warned(&loaded),
            ["node 0: the last row of its matrix is nearly, and taken as, [0, 0, 0, 1]"]
        );
        matrix[at] = right;
    }
    matrix[15] = 0.9;
    asset.json["nodes"][0]["matrix"] = json!(matrix);
    assert!(
        asset.error().contains("the last row of its matrix is [0.0, 0.0, 0.0, 0.9]"),
        "{}",
        asset.error()
    );
}

#[test]
fn a_zero_quaternion_is_no_rotation() {
    // The case zero_quaternion, and the same of the node with the mesh and of an instance.
    let mut asset = Asset::triangle();
    asset.json["nodes"][0]["rotation"] = json!([0, 0, 0, 0]);
    asset.push("nodes", json!({ "name": "empty", "rotation": [0.0, 0.0, 0.0, 0.0] }));
    let loaded = asset.load();
    close(&world(&loaded), &[UNIT], 0.0);
    let told = warned(&loaded);
    assert!(
        told[0].starts_with("node ") && told[0].ends_with("its quaternion is zero, and read as no rotation")
    );
    let rotations = asset.floats("VEC4", &[[0.0; 4], [0.0, 0.0, 0.0, 1.0]]);
    asset.json["nodes"] = json!([{ "mesh": 0,
        "extensions": { "EXT_mesh_gpu_instancing": { "attributes": { "ROTATION": rotations } } } }]);
    let loaded = asset.load();
    close(&world(&loaded), &[UNIT, UNIT], 0.0);
    assert_eq!(
        warned(&loaded),
        ["node 0, EXT_mesh_gpu_instancing, instance 0: its quaternion is zero, and read as no rotation"]
    );
}

// ---- Meshes ----

#[test]
fn the_largest_index_is_one_where_there_is_such_a_vertex() {
    // The case index_65535, and the same of bytes.
    for (component, count) in [(UBYTE, 256_usize), (USHORT, 65_536)] {
        let mut asset = Asset::new();
        let mut corners = vec![[0.0; 3]; count];
        corners[count - 3..].copy_from_slice(&CORNERS);
        let positions = asset.floats("VEC3", &corners);
        let last = count as u32 - 1;
        let size = if component == UBYTE { 1 } else { 2 };
        let bytes: Vec<u8> =
            [last - 2, last - 1, last].iter().flat_map(|i| i.to_le_bytes()[..size].to_vec()).collect();
        let indices = asset.accessor("SCALAR", component, 3, &bytes);
        let mesh = asset.mesh(json!({ "attributes": { "POSITION": positions }, "indices": indices }));
        asset.push("nodes", json!({ "mesh": mesh }));
        let loaded = asset.load();
        close(&world(&loaded), &[UNIT], 0.0);
        assert_eq!(
            warned(&loaded),
            [
                "mesh 0, primitive 0: the largest integer of its indices' type is taken as an index, since there is \
                 such a vertex; glTF leaves it out"
            ]
        );
    }
}

#[test]
fn strips_and_fans_restart_where_an_extension_says_so() {
    // The case primitive_restart_ext.
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0_f32]];
    let mut positions = corners.to_vec();
    positions.extend(corners.map(|[x, y, z]| [x + 5.0, y, z]));
    for (mode, indices, count) in [
        (5, vec![0, 1, 2, 3, 65_535, 4, 5, 6, 7], 4),
        (5, vec![65_535, 0, 1, 2, 3, 65_535, 65_535, 4, 5, 65_535, 4, 5, 6, 7, 65_535], 4),
        (6, vec![0, 1, 3, 2, 65_535, 4, 5, 7, 6], 4),
    ] {
        let mut asset = Asset::new();
        let positions = asset.floats("VEC3", &positions);
        let indices = asset.shorts(&indices);
        let primitive = json!({ "attributes": { "POSITION": positions }, "indices": indices, "mode": mode });
        let mesh = asset.mesh(primitive);
        asset.push("nodes", json!({ "mesh": mesh }));
        assert!(asset.error().contains("EXT_mesh_primitive_restart"), "{}", asset.error());
        for extension in ["EXT_mesh_primitive_restart", "KHR_mesh_primitive_restart"] {
            for list in ["extensionsUsed", "extensionsRequired"] {
                let mut asset = Asset { json: asset.json.clone(), data: asset.data.clone() };
                asset.json[list] = json!([extension]);
                let loaded = asset.load();
                let triangles = world(&loaded);
                assert_eq!(triangles.len(), count, "mode {mode}");
                let normals = triangles.iter().map(|[a, b, c]| (*b - *a).cross(*c - *a));
                assert!(normals.clone().all(|normal| normal.z == 1.0), "mode {mode}");
                assert_eq!(warned(&loaded), [""; 0]);
            }
        }
    }
}

#[test]
fn a_skin_without_joints_leaves_its_mesh_where_the_node_is() {
    // The case skin_without_joints. Of two primitives, one has joints.
    let mut asset = Asset::triangle();
    asset.json["nodes"] = json!([
        { "name": "wall", "mesh": 0, "skin": 0, "translation": [5, 0, 0] },
        { "translation": [0, 0, 9] },
    ]);
    asset.json["skins"] = json!([{ "joints": [1] }]);
    let loaded = asset.load();
    close(&world(&loaded), &[unit_at(5.0, 0.0, 0.0)], 0.0);
    let expected = "mesh 0, primitive 0: its node has a skin, but it has no JOINTS_0 and WEIGHTS_0: it stands where its node is";
    assert_eq!(warned(&loaded), [expected]);
    let joints = asset.accessor("VEC4", UBYTE, 3, &[0; 12]);
    let weights = asset.floats("VEC4", &[[1.0, 0.0, 0.0, 0.0]; 3]);
    let attributes = json!({ "POSITION": 0, "JOINTS_0": joints, "WEIGHTS_0": weights });
    let primitives = asset.json["meshes"][0]["primitives"].as_array_mut().unwrap();
    primitives.push(json!({ "attributes": attributes, "indices": 1 }));
    let loaded = asset.load();
    close(&world(&loaded), &[unit_at(5.0, 0.0, 0.0), unit_at(0.0, 0.0, 9.0)], 0.0);
}

#[test]
fn a_stride_of_zero_means_no_gaps() {
    // The case stride0.
    let mut asset = Asset::triangle();
    asset.json["bufferViews"][0]["byteStride"] = json!(0);
    let loaded = asset.load();
    close(&world(&loaded), &[UNIT], 0.0);
    assert_eq!(warned(&loaded), ["bufferView 0: its byteStride of 0 is read as elements without gaps"]);
}

#[test]
fn geometry_in_an_extension_that_is_not_read_is_no_silence() {
    // The kind of the case draco_used_not_required: the data are in an extension that the file does not require.
    let mut asset = Asset::triangle();
    asset.json["meshes"][0]["primitives"][0]["extensions"] = json!({ "ACME_squeezed_mesh": { "view": 0 } });
    close(&world(&asset.load()), &[UNIT], 0.0);
    for accessor in 0..2 {
        let mut hollow = Asset { json: asset.json.clone(), data: asset.data.clone() };
        hollow.json["accessors"][accessor].as_object_mut().unwrap().remove("bufferView");
        let mesh = hollow.mesh(json!({ "attributes": { "POSITION": 0 } }));
        hollow.push("nodes", json!({ "mesh": mesh }));
        assert_eq!(
            hollow.error(),
            "node 0, mesh 0, primitive 0: its data are in the extension \"ACME_squeezed_mesh\", which beamcast does not \
             read (export the file without it)"
        );
        // An extension that carries no data does not change what is said of the accessor.
        hollow.json["meshes"][0]["primitives"][0]["extensions"] = json!({ "KHR_materials_variants": {} });
        if accessor == 1 {
            let expected =
                "mesh 0, primitive 0: an accessor of it has no data: its vertices or indices are all zero";
            assert!(warnings(&hollow).contains(&expected.to_owned()));
        }
    }
}

#[test]
fn a_view_whose_data_are_in_an_extension_names_it() {
    let mut asset = Asset::triangle();
    asset.json["bufferViews"][0]["extensions"] = json!({ "ACME_squeezed_view": {} });
    close(&world(&asset.load()), &[UNIT], 0.0);
    asset.json["bufferViews"][0]["buffer"] = json!(1);
    let mut json: Value = serde_json::from_str(&asset.text()).unwrap();
    json["buffers"].as_array_mut().unwrap().push(json!({ "byteLength": 36 }));
    let error = load_bytes(json.to_string().as_bytes(), &plain()).unwrap_err().to_string();
    assert!(error.contains("bufferView 0, buffer 1: the buffer has no uri"), "{error}");
    assert!(
        error.ends_with("(it has the extension \"ACME_squeezed_view\", which beamcast does not read)"),
        "{error}"
    );
}

#[test]
fn an_accessor_without_a_count_is_an_error() {
    let mut asset = Asset::triangle();
    asset.json["accessors"][0].as_object_mut().unwrap().remove("count");
    assert_eq!(asset.error(), "node 0, mesh 0, primitive 0, accessor 0: it has no count");
}

#[test]
fn the_origin_of_a_tile_is_a_translation_of_all_roots() {
    // The cases cesium_rtc_required and cesium_rtc_used.
    let mut asset = Asset::triangle();
    asset.json["extensions"] = json!({ "CESIUM_RTC": { "center": [4_000_000.125, 200.0, 300.0] } });
    asset.json["nodes"] =
        json!([{ "children": [1], "scale": [2, 2, 2] }, { "mesh": 0, "translation": [1, 0, 0] }]);
    for list in ["extensionsUsed", "extensionsRequired"] {
        asset.json[list] = json!(["CESIUM_RTC"]);
        let loaded = asset.load();
        let triangles = world(&loaded);
        assert_eq!(triangles[0][0], DVec3::new(4_000_002.125, 200.0, 300.0));
        assert_eq!(warned(&loaded), [""; 0]);
    }
    asset.json["extensions"]["CESIUM_RTC"]["center"] = json!([1, 2]);
    assert!(asset.error().starts_with("extensions, CESIUM_RTC, center"), "{}", asset.error());
}

// ---- JSON ----

#[test]
fn null_is_as_if_it_was_not_there() {
    // The cases null_children and null_extensions, and every other member with a default.
    let asset = Asset::triangle();
    let members = [
        ("/nodes/0", "children"),
        ("/nodes/0", "extensions"),
        ("/nodes/0", "rotation"),
        ("/nodes/0", "name"),
        ("/nodes/0", "skin"),
        ("/meshes/0", "weights"),
        ("/meshes/0/primitives/0", "targets"),
        ("/meshes/0/primitives/0", "mode"),
        ("/meshes/0/primitives/0", "extensions"),
        ("/meshes/0/primitives/0/attributes", "NORMAL"),
        ("/accessors/0", "byteOffset"),
        ("/accessors/0", "normalized"),
        ("/accessors/0", "sparse"),
        ("/bufferViews/0", "byteStride"),
        ("/bufferViews/1", "extensions"),
        ("", "scenes"),
        ("", "skins"),
        ("", "materials"),
        ("", "extensionsUsed"),
        ("", "extensions"),
        ("/asset", "minVersion"),
    ];
    for (element, key) in members {
        let mut asset = Asset { json: asset.json.clone(), data: asset.data.clone() };
        asset.json.pointer_mut(element).unwrap()[key] = Value::Null;
        let loaded = asset.load();
        close(&world(&loaded), &[UNIT], 0.0);
        let told = warned(&loaded);
        assert_eq!(told.len(), 1, "{told:?}");
        assert!(told[0].ends_with(&format!("{key}: null is read as if it was not there")), "{told:?}");
    }
    let mut asset = Asset { json: asset.json.clone(), data: asset.data.clone() };
    asset.json["nodes"][0]["name"] = json!("Car");
    asset.json["nodes"][0]["children"] = Value::Null;
    assert_eq!(warnings(&asset), ["node 0 \"Car\", children: null is read as if it was not there"]);
}

/// Programs that number elements from 0 write -1 for none.
#[test]
fn minus_one_is_no_element() {
    let asset = Asset::triangle();
    for (element, key) in
        [("/nodes/0", "skin"), ("/nodes/0", "camera"), ("/meshes/0/primitives/0", "material"), ("", "scene")]
    {
        let mut asset = Asset { json: asset.json.clone(), data: asset.data.clone() };
        asset.json.pointer_mut(element).unwrap()[key] = json!(-1);
        let loaded = asset.load();
        close(&world(&loaded), &[UNIT], 0.0);
        let told = warned(&loaded);
        assert!(
            told.len() == 1
                && told[0].ends_with(&format!("{key}: -1 is no element, and is read as if it was not there")),
            "{told:?}"
        );
    }
    // An index of a list and a coordinate may not be left out, and `extras` are the user's.
    let mut asset = Asset { json: asset.json.clone(), data: asset.data.clone() };
    asset.json["nodes"][0]["extras"] = json!({ "mesh": -1 });
    asset.json["nodes"][0]["translation"] = json!([-1, 0, 0]);
    assert_eq!(warnings(&asset), Vec::<String>::new());
    asset.json["nodes"][0]["children"] = json!([-1]);
    assert!(asset.error().contains("children"));
}

#[test]
fn null_among_elements_keeps_the_numbers_of_the_others() {
    let mut asset = Asset::triangle();
    asset.json["nodes"] = json!([null, { "mesh": 1, "children": [null, 2, null] }, { "mesh": 1 }]);
    let mesh = asset.json["meshes"][0].take();
    asset.json["meshes"] = json!([null, mesh]);
    asset.json["materials"] = json!([null, { "name": "paint" }]);
    asset.json["meshes"][1]["primitives"][0]["material"] = json!(1);
    asset.json["scenes"] = json!([{ "nodes": [1, null] }]);
    asset.json["extensionsUsed"] = json!([null]);
    asset.json["nodes"][2]["extras"] = json!({ "label": null });
    asset.json["nodes"][2]["extensions"] = json!({ "ACME_x": { "is": null } });
    let loaded = asset.load();
    close(&world(&loaded), &[UNIT, UNIT], 0.0);
    assert_eq!(loaded.scene.geometry.materials[1].name, "paint");
    let told = warned(&loaded);
    assert!(told[0].contains(" and 6 others ("), "{told:?}");
    // A number of the geometry can't be absent.
    asset.json["nodes"][1]["translation"] = json!([0, null, 0]);
    let error = asset.error();
    assert!(
        error.starts_with("node 1, translation 1: the JSON is not what glTF asks for: invalid type: null"),
        "{error}"
    );
}

#[test]
fn numbers_that_are_none_do_no_harm_where_none_is_needed() {
    // The case json_inf_material.
    let mut asset = Asset::triangle();
    asset.json["materials"] = json!([{
        "name": "m",
        "extensions": { "KHR_materials_volume": { "thicknessFactor": "@" } },
        "emissiveFactor": ["@", 0, 0],
    }]);
    asset.json["accessors"][0]["max"] = json!(["@", 1, 0]);
    asset.json["nodes"][0]["extras"] = json!({ "mass": "@", "label": 7 });
    let text = asset.text();
    for word in ["inf", "-inf", "Infinity", "-Infinity", "NaN", "nan", "-nan(ind)", "1.#INF", "-1.#IND00"] {
        let loaded = load_bytes(text.replace("\"@\"", word).as_bytes(), &plain()).unwrap();
        close(&world(&loaded), &[UNIT], 0.0);
        assert_eq!(loaded.scene.geometry.objects[0].file_label, Some(7));
        let told = warned(&loaded);
        assert_eq!(told.len(), 1, "{told:?}");
        assert!(
            told[0].ends_with("inf or NaN is neither JSON nor a number of glTF, and is passed over"),
            "{told:?}"
        );
        assert!(
            told[0].contains("material 0 \"m\", extensions, KHR_materials_volume, thicknessFactor"),
            "{told:?}"
        );
    }
    // Where the geometry needs a number, the element is named.
    asset.json["nodes"][0] = json!({ "mesh": 0, "name": "Car", "scale": [1, "@", 1] });
    let error = load_bytes(asset.text().replace("\"@\"", "NaN").as_bytes(), &plain()).unwrap_err();
    assert_eq!(error.element, "node 0 \"Car\", scale 1");
    assert!(
        error.problem.contains("there is no number where one is wanted (inf and NaN are none)"),
        "{error}"
    );
}

#[test]
fn errors_in_a_binary_file_name_the_element_and_show_the_text() {
    let mut asset = Asset::triangle();
    asset.json["nodes"][0] = json!({ "name": "Car", "mesh": "zero" });
    let binary = load_bytes(&glb(asset.text().as_bytes(), b""), &plain()).unwrap_err();
    assert_eq!(binary.element, "node 0 \"Car\", mesh");
    assert!(!binary.problem.contains("column"), "{binary}");
    assert!(binary.problem.contains("\"mesh\":\"zero"), "{binary}");
    let text = load_bytes(asset.text().as_bytes(), &plain()).unwrap_err();
    assert_eq!(text.element, "node 0 \"Car\", mesh");
    assert!(text.problem.contains("at line 1 column"), "{text}");
    let broken = asset.text().replace("\"mesh\":\"zero\"", "\"mesh\" 0");
    let error = load_bytes(&glb(broken.as_bytes(), b""), &plain()).unwrap_err();
    assert!(error.problem.contains("expected `:`"), "{error}");
    assert!(error.problem.contains("\"mesh\"▸0"), "{error}");
    assert!(error.element.starts_with("node 0"), "{error}");
}

#[test]
fn whole_numbers_may_have_a_fraction_of_zero() {
    // glTF recommends that they have none; the value is the same.
    let mut asset = Asset::triangle();
    asset.json["nodes"] = json!([
        { "children": ["1@"], "translation": [0.0, 2.0, 0.0] },
        { "mesh": "0@", "translation": [0.5, 0, 0] },
    ]);
    asset.json["accessors"][0]["count"] = json!("3@");
    asset.json["accessors"][0]["componentType"] = json!("5126@");
    asset.json["bufferViews"][1]["byteOffset"] = json!("36@");
    asset.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!("0@");
    asset.json["meshes"][0]["primitives"][0]["indices"] = json!("1@");
    asset.json["meshes"][0]["primitives"][0]["mode"] = json!("4@");
    asset.json["scenes"] = json!([{ "nodes": ["0@"] }]);
    asset.json["scene"] = json!("0@");
    let whole = |fraction: &str| {
        let mut text = asset.text();
        for digits in ["0", "1", "3", "4", "36", "5126"] {
            text = text.replace(&format!("\"{digits}@\""), &format!("{digits}{fraction}"));
        }
        load_bytes(text.as_bytes(), &plain())
    };
    for fraction in ["", ".0", ".000"] {
        let loaded = whole(fraction).unwrap();
        close(&world(&loaded), &[unit_at(0.5, 2.0, 0.0)], 0.0);
        assert_eq!(warned(&loaded), [""; 0]);
    }
    assert!(whole(".5").is_err());
}

#[test]
fn names_that_are_no_texts_do_no_harm() {
    let mut asset = Asset::triangle();
    for (name, expected) in
        [(json!(12), "12"), (json!([1]), ""), (json!({}), ""), (json!(true), ""), (json!("a"), "a")]
    {
        for list in ["nodes", "meshes"] {
            asset.json[list][0]["name"] = name.clone();
        }
        asset.json["scenes"] = json!([{ "name": name, "nodes": [0] }]);
        assert_eq!(asset.load().scene.geometry.objects[0].name, expected);
    }
}

#[test]
fn padding_and_marks_around_the_json_are_passed_over() {
    // The case json_nul_padded.
    let text = Asset::triangle().text();
    for padding in ["\0", "\0\0\0", " \0\0", "\0 \0\n"] {
        for file in [format!("{text}{padding}").into_bytes(), glb(format!("{text}{padding}").as_bytes(), b"")]
        {
            let loaded = load_bytes(&file, &plain()).unwrap();
            close(&world(&loaded), &[UNIT], 0.0);
            assert_eq!(
                warned(&loaded),
                ["the JSON is padded with NUL characters, where glTF asks for spaces"]
            );
        }
    }
    let loaded = load_bytes(format!("\u{feff}{text}").as_bytes(), &plain()).unwrap();
    assert_eq!(warned(&loaded), ["the JSON begins with a byte order mark, which is passed over"]);
}

#[test]
fn names_that_are_not_utf_8_are_read_with_marks() {
    let mut asset = Asset::triangle();
    asset.json["nodes"][0]["name"] = json!("Stra@e");
    let bytes: Vec<u8> = asset.text().bytes().map(|b| if b == b'@' { 0xdf } else { b }).collect();
    let loaded = load_bytes(&bytes, &plain()).unwrap();
    assert_eq!(loaded.scene.geometry.objects[0].name, "Stra\u{fffd}e");
    assert_eq!(warned(&loaded), ["the JSON is not UTF-8; the characters that can't be read are replaced"]);
}

// ---- Materials and what is not read ----

#[test]
fn a_material_never_keeps_geometry_from_being_read() {
    // The case basecolor3, and its neighbours.
    let color = |material: Value| {
        let mut asset = Asset::triangle();
        asset.json["materials"] = json!([material]);
        asset.json["meshes"][0]["primitives"][0]["material"] = json!(0);
        let loaded = asset.load();
        (loaded.scene.geometry.materials[0].base_color, warned(&loaded).join("; "))
    };
    let pbr = |factor: Value| json!({ "name": "m", "pbrMetallicRoughness": { "baseColorFactor": factor } });
    let (found, told) = color(pbr(json!([0.5, 0.25, 0.125])));
    assert_eq!(found, [0.5, 0.25, 0.125, 1.0]);
    assert_eq!(
        told,
        "material 0 \"m\": its baseColorFactor has three numbers, not four; its alpha is taken as 1"
    );
    for wrong in
        [json!([0.5]), json!([]), json!([0, 0, 0, 0, 0]), json!("red"), json!({}), json!([[0, 0, 0, 1]])]
    {
        let (found, told) = color(pbr(wrong));
        assert_eq!(found, [1.0; 4]);
        assert!(told.starts_with("material 0 \"m\": its baseColorFactor"), "{told}");
    }
    for wrong in [
        json!(5),
        json!({ "name": 7 }),
        json!({ "pbrMetallicRoughness": 3 }),
        json!({ "extensions": 2 }),
        json!({ "extensions": { "KHR_materials_pbrSpecularGlossiness": 0 } }),
    ] {
        let (found, told) = color(wrong);
        assert_eq!(found, [1.0; 4]);
        assert!(told.starts_with("material 0: i"), "{told}");
    }
    for strange in
        [json!({ "alphaMode": 3 }), json!({ "normalTexture": [] }), json!({ "extensions": [] }), json!([])]
    {
        assert_eq!(color(strange).0, [1.0; 4]);
    }
    for list in ["materials", "cameras", "animations"] {
        let mut asset = Asset::triangle();
        asset.json[list] = json!({ "a": 1 });
        let told = warnings(&asset).join("; ");
        assert!(told.contains(&format!("{list}: this is no list of objects, and is not read")), "{told}");
    }
}

#[test]
fn what_is_not_read_is_counted_and_named() {
    // The cases animations and cameras.
    let mut asset = Asset::triangle();
    assert_eq!(notes(&asset), [""; 0]);
    asset.json["materials"] = json!([
        { "name": "pane", "alphaMode": "BLEND" },
        { "name": "glass", "extensions": { "KHR_materials_transmission": { "transmissionFactor": 1.0 } } },
        { "name": "leaf", "alphaMode": "MASK", "extensions": { "KHR_materials_diffuse_transmission": {} } },
    ]);
    asset.json["animations"] = json!([{}]);
    asset.json["cameras"] = json!([{ "type": "perspective" }]);
    asset.push("nodes", json!({ "name": "Camera", "camera": 0 }));
    asset.json["extensionsUsed"] =
        json!(["KHR_materials_transmission", "MSFT_lod", "KHR_texture_transform", "KHR_mesh_quantization"]);
    assert_eq!(
        notes(&asset),
        [
            "animation 0: it moves nothing",
            "material 2 \"leaf\": diffuse transmission is not read: beams take the surface as solid",
            "node 1 \"Camera\": cameras of the file are not used: a job places its own sensors (`beamcast info` lists \
             cameras)",
            "extensionsUsed: 1 extension is not read: \"MSFT_lod\"",
        ]
    );
    assert!(warnings(&asset).is_empty());
}
