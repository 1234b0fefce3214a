//! One HTML page that needs no other file: range images, a cloud to turn, and tables.
//!
//! The page holds its data, its style and its script, and its content security policy allows just this style and this script,
//! by their hashes: no network, no plugin and no other script, whatever the names in a scene are. All text is escaped here, and
//! the script sets it as text.
//!
//! Ranges and other measurements are exact (32 bits). Values that are only for the eye are rounded: intensities to 1/65535,
//! normals to 1/127, points to 1/65535 of the cloud's box.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use serde_json::{Value, json};

use super::frames::{Shown, View};
use super::html::{escape, script};
use super::rig::Rig;
use super::thin::Thinned;
use super::{ground, pack};
use crate::check::{GroundMap, SensorOutcome, colours, difference_scale};
use crate::output::{
    self, Channel, DEPTH_FOR_OPENCV, Image, NO_RETURN_COLOUR, NO_RETURN_M, Samples, Scale, Values,
};
use crate::source::words::{counted, escaped};

const SCRIPT: &str = concat!(include_str!("values.js"), include_str!("cloud.js"), include_str!("page.js"));
const STYLE: &str = include_str!("page.css");

/// The largest picture that every browser draws, in pixels each way.
const MAX_PICTURE: usize = 16_384;

/// The page that shows frames, with a note above them, which may be empty.
pub fn of_views(title: &str, note: &str, shown: &Shown) -> String {
    let mut body = String::new();
    if !note.is_empty() {
        let _ = write!(body, "<p>{}</p>", escape(note));
    }
    let names = shown.views.iter().map(|view| view.name.as_str()).collect::<Vec<_>>();
    body += &rig("job0", &shown.rig, &names);
    for (index, view) in shown.views.iter().enumerate() {
        body += &section(&format!("job0-frame{index}"), view, None, names.len());
    }
    document(title, &body)
}

/// The sections of a rig: all clouds in the vehicle's frame, and the ground that it sees. Nothing for a lone sensor without a
/// vehicle. `names` are those of the frames on the page.
pub(super) fn rig(id: &str, rig: &Rig, names: &[&str]) -> String {
    let mut html = String::new();
    if rig.sensors.len() > 1 || rig.vehicle.is_some() {
        html += &rig_section(id, rig, names);
    }
    html + &rig.ground.as_ref().map_or(String::new(), |map| ground::section(&format!("{id}-ground"), map))
}

pub(super) fn rig_section(id: &str, rig: &Rig, names: &[&str]) -> String {
    let floats = |all: &mut dyn Iterator<Item = f32>| {
        pack::base64(&all.flat_map(f32::to_le_bytes).collect::<Vec<u8>>())
    };
    let sensor = |mounted: &super::rig::Mounted| {
        let index = names.iter().position(|name| *name == mounted.name)?;
        let pose = mounted.body_from_sensor;
        let columns = [0, 1, 2].map(|axis| pose.rotation.col(axis).extend(0.0).to_array());
        let mount: Vec<f64> =
            columns.iter().flatten().copied().chain(pose.translation.extend(1.0).to_array()).collect();
        Some(json!({
            "section": format!("{id}-frame{index}"),
            "name": escaped(&mounted.name),
            "mount": mount,
            "edges": floats(&mut mounted.edges.iter().flatten().flatten().copied()),
        }))
    };
    let sensors: Vec<Value> = rig.sensors.iter().filter_map(sensor).collect();
    let vehicle = rig.vehicle.as_ref();
    let data = json!({
        "sensors": sensors,
        "vehicle": vehicle.map(|v| floats(&mut v.triangles.iter().flatten().flatten().copied())),
    });
    let who = if vehicle.is_some() { "The rig on its vehicle" } else { "The rig" };
    let label = format!(
        "{who}: the clouds of {} in the vehicle's frame, with their fields of view. Arrow keys turn it, plus and minus zoom, \
         Shift with arrow keys moves it, 0 shows all again.",
        counted(sensors.len(), "sensor")
    );
    format!(
        "<section id=\"{id}-rig\" class=\"rig\" aria-label=\"{who}\" aria-busy=\"true\"><h3>{who}</h3>\
         <div class=\"controls\"></div>{}<div class=\"legend\"></div>{}</section>",
        cloud(&label),
        script(&data)
    )
}

/// The canvas of a cloud, which `label` describes, and how to turn it.
fn cloud(label: &str) -> String {
    format!(
        "<div class=\"waiting\"><canvas class=\"cloud\" tabindex=\"0\" role=\"application\" aria-label=\"{label}\"></canvas></div>\
         <p class=\"hint cloud-hint\">Drag to turn, wheel or two fingers to zoom, Shift-drag or right button to move; arrow keys, \
         + and −, 0 for the whole. Axes: x forward red, y left green, z up blue, one metre each.</p>\
         <p class=\"hint no-webgl\" hidden>This browser shows no WebGL2, so there is no cloud to turn here. \
         The pictures do not need it.</p>"
    )
}

/// What the section of a frame needs to know of it.
#[derive(Clone, Debug)]
pub(super) struct Part {
    /// Rows and columns, before anything was left out.
    whole: [usize; 2],
    /// Rows and columns that are shown.
    shown: [usize; 2],
    /// The ratio of height to width of a pixel.
    stretch: usize,
    /// The number of points, or why there are none.
    points: Result<usize, String>,
}

impl Part {
    pub fn of(whole: &View, thinned: &Thinned) -> Self {
        let image = &thinned.view.image;
        Self {
            whole: [whole.image.rows, whole.image.columns],
            shown: [image.rows, image.columns],
            stretch: stretch(image),
            points: thinned.view.points.as_ref().map(Vec::len).map_err(Clone::clone),
        }
    }
}

/// The section of a frame: controls, pictures, cloud, and the numbers behind them. The script fills it when it comes into
/// sight. `compared` is the outcome of comparing the frame with its baseline. The page has so many `frames`, which share what
/// a browser can show.
pub(super) fn section(id: &str, view: &View, compared: Option<&SensorOutcome>, frames: usize) -> String {
    let baseline = compared.and_then(|sensor| sensor.baseline.as_ref());
    let thinned = Thinned::of(view, baseline, frames);
    let captions = thinned.baseline.as_ref().map(|_| ["baseline", "run", "difference"]);
    let data = script(&data(&thinned, compared));
    section_of(id, &view.title(), &Part::of(view, &thinned), &thinned.note, captions, &data)
}

/// The section of a frame that is called `name`, of which `note` says what is left out. It has a picture of the run alone, or those
/// of the captions. `data` are the elements that hold its numbers.
pub(super) fn section_of(
    id: &str,
    name: &str,
    part: &Part,
    note: &str,
    captions: Option<[&str; 3]>,
    data: &str,
) -> String {
    let name = escape(name);
    let ([rows, columns], [all_rows, all_columns], stretch) = (part.shown, part.whole, part.stretch);
    let size = format!("{all_rows} × {all_columns}");
    let fits = rows <= MAX_PICTURE && columns <= MAX_PICTURE;
    let is_picture = fits && rows > 1 && columns > 1;
    let wide = columns > 2 * rows * stretch;
    let mut pictures = match note {
        "" => String::new(),
        note => format!("<p class=\"hint\">{note}</p>"),
    };
    if is_picture {
        let captions: &[&str] = captions.as_ref().map_or(&["run"], |captions| captions);
        let class = if wide { "pictures wide" } else { "pictures" };
        let _ = write!(pictures, "<div class=\"{class}\">");
        for caption in captions {
            let shown = if captions.len() == 1 {
                String::new()
            } else {
                format!("<figcaption>{caption}</figcaption>")
            };
            // Until the script draws the picture, these sides give it its shape.
            let height = (1000 * rows * stretch).div_ceil(columns);
            let _ = write!(
                pictures,
                "<figure>{shown}<div class=\"picture waiting\"><canvas data-picture=\"{caption}\" width=\"1000\" \
                 height=\"{height}\" tabindex=\"0\" role=\"img\" aria-label=\"{name}, {caption}: range image of {size} \
                 pixels. Arrow keys move from pixel to pixel.\"></canvas><div class=\"marker\" hidden></div></div></figure>"
            );
        }
        pictures += "</div><p class=\"hint\">Point at a pixel, or move with the arrow keys (Shift: by ten).</p>\
                     <output class=\"values\"></output>";
    } else if all_rows > 1 {
        let _ =
            write!(pictures, "<p class=\"hint\">An image of {size} pixels is too large for a picture.</p>");
    }
    let cloud = match &part.points {
        Ok(points) => cloud(&format!(
            "{name}: cloud of {}. Arrow keys turn it, plus and minus zoom, Shift with arrow keys moves it, 0 shows all again.",
            counted(*points, "point")
        )),
        Err(why) => format!("<p class=\"hint\">{}</p>", escape(why)),
    };
    format!(
        "<section id=\"{id}\" class=\"view\" aria-label=\"{name}\" aria-busy=\"true\"><h3><bdi>{name}</bdi> <small>{}</small></h3>\
         <div class=\"controls\"></div>{pictures}<div class=\"legend\"></div>{cloud}{data}</section>",
        if all_rows > 1 { format!("{size} pixels") } else { counted(all_columns, "point") },
    )
}

/// The numbers of a frame, for the script.
pub(super) fn data(thinned: &Thinned, compared: Option<&SensorOutcome>) -> Value {
    let (view, baseline) = (thinned.view.as_ref(), thinned.baseline.as_deref());
    let image = &view.image;
    let resolution = |channel: &str| {
        let all = compared.map_or(&[][..], |sensor| &sensor.channels);
        all.iter().find(|c| c.channel == channel).map_or(0.0, |c| c.resolution)
    };
    json!({
        "rows": image.rows,
        "columns": image.columns,
        "steps": thinned.steps,
        "stretch": stretch(image),
        "channels": channels(image, &|_| json!({})),
        "baseline": baseline.map(|before| {
            channels(before, &|name| {
                let resolution = resolution(name);
                json!({ "resolution": resolution, "difference_scale": scale_of_difference(name, [before, image], resolution) })
            })
        }),
        "points": view.points.as_ref().ok().map(|points| pack::points(points)),
        "instances": names_of_seen("id.instance", &view.instances, [Some(image), baseline]),
        "labels": names_of_seen("id.semantic", &view.labels, [Some(image), baseline]),
    })
}

/// The end of the scale that shows how a channel differs between a first and a second image. 0 if it does not, or if the
/// differences have no size.
fn scale_of_difference(name: &str, images: [&Image; 2], resolution: f64) -> f64 {
    let [before, now] = images;
    let axes: Vec<String> = match output::channel(name).and_then(|spec| spec.shown).map(|shown| shown.scale) {
        Some(Scale::Direction) => {
            ["X", "Y", "Z"].map(|axis| format!("{}{axis}", name.trim_end_matches('X'))).to_vec()
        }
        _ => vec![name.to_owned()],
    };
    let pairs = axes.iter().map(|axis| Some((before.f32(axis)?, now.f32(axis)?)));
    let Some(pairs) = pairs.collect::<Option<Vec<_>>>() else { return 0.0 };
    let (was, is) = (before.mask(), now.mask());
    let difference = |i: usize| {
        let squares = pairs.iter().map(|(a, b)| f64::from(b[i] - a[i])).map(|d| d * d);
        squares.sum::<f64>().sqrt()
    };
    let both = (0..now.pixels()).filter(|&i| was[i] && is[i]).map(difference);
    difference_scale(both.filter(|d| *d > resolution / 2.0).collect())
}

/// The ratio of height to width of a pixel as it is shown. A LiDAR has far fewer beams than firings, so its image is made a tenth
/// as tall as it is wide, or taller, which is about the ratio of most fields of view.
fn stretch(image: &Image) -> usize {
    let is_camera = image.channel("Z").is_some();
    if is_camera {
        1
    } else {
        ((image.columns as f64 / (10 * image.rows.max(1)) as f64).round() as usize).clamp(1, 64)
    }
}

/// The names of the ids that a channel of some image has.
fn names_of_seen(
    channel: &str,
    names: &BTreeMap<u32, String>,
    images: [Option<&Image>; 2],
) -> BTreeMap<u32, String> {
    let ids = images.into_iter().flatten().filter_map(|image| image.u32(channel)).flatten();
    let seen: BTreeSet<u32> = ids.copied().collect();
    let name = |id| names.get(&id).filter(|name| !name.is_empty()).map(|name| (id, escaped(name)));
    seen.into_iter().filter_map(name).collect()
}

/// The channels in the order in which people ask for them, each with the settings by which the script shows it.
fn channels(image: &Image, more: &dyn Fn(&str) -> Value) -> Value {
    // A channel that has no declaration is from a file of someone else's, and comes last.
    const LAST: u8 = u8::MAX;
    let (main, depth) = image.main_depth().unzip();
    let mut shown: Vec<(u8, &Channel)> = Vec::new();
    for channel in &image.channels {
        match output::channel(&channel.name) {
            Some(spec) => shown.extend(spec.shown.map(|shown| (shown.rank, channel))),
            None if channel.name == DEPTH_FOR_OPENCV && main != Some(DEPTH_FOR_OPENCV) => {} // it repeats another
            None => shown.push((LAST, channel)),
        }
    }
    shown.sort_by_key(|(rank, _)| *rank);
    let all = shown
        .into_iter()
        .filter_map(|(_, Channel { name, samples })| channel(image, name, samples, depth, more(name)));
    Value::Array(all.collect())
}

fn channel(
    image: &Image,
    name: &str,
    samples: &Samples,
    depth: Option<&[f32]>,
    more: Value,
) -> Option<Value> {
    let columns = image.columns;
    let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    let spec = output::channel(name);
    let (label, scale) = match spec.and_then(|spec| spec.shown) {
        Some(shown) => (shown.label, shown.scale),
        None if name == DEPTH_FOR_OPENCV => (name, Scale::Log),
        None if matches!(samples, Samples::U32(_)) => (name, Scale::Id),
        None => (name, Scale::Linear),
    };
    let unit = spec.map_or(if name == DEPTH_FOR_OPENCV { "m" } else { "" }, |spec| spec.unit);
    let scale_name = match scale {
        Scale::Log => "log",
        Scale::Linear => "linear",
        Scale::Direction => "normal",
        Scale::Id => "id",
    };
    let packed = match (name, samples) {
        _ if scale == Scale::Direction => {
            let stem = name.strip_suffix('X')?;
            let axes = ["X", "Y", "Z"].map(|axis| image.f32(&format!("{stem}{axis}")));
            let [Some(x), Some(y), Some(z)] = axes else { return None };
            let axis = |values: &[f32]| {
                let rounded = values.iter().map(|v| (v.clamp(-1.0, 1.0) * 127.0).round() as i8 as u8);
                pack::numbers("i8", &rounded.map(u32::from).collect::<Vec<_>>(), 1, columns)
            };
            json!([axis(x), axis(y), axis(z)])
        }
        ("intensity", Samples::F32(values)) if values.iter().all(|v| (0.0..=1.0).contains(v)) => {
            let rounded: Vec<u32> = values.iter().map(|v| (v * 65535.0).round() as u32).collect();
            json!([pack::numbers("u16", &rounded, 2, columns)])
        }
        // Nothing is known of a pixel without a return, and a channel's 0 there would only cost bytes.
        (_, Samples::F32(values)) if scale == Scale::Log => {
            let known = |v: &f32| if v.is_finite() { *v } else { NO_RETURN_M as f32 };
            json!([pack::numbers("f32", &bits(&values.iter().map(known).collect::<Vec<_>>()), 4, columns)])
        }
        (_, Samples::F32(values)) => json!([pack::numbers("f32", &bits(values), 4, columns)]),
        (_, Samples::U32(values)) => json!([pack::numbers("u32", values, 4, columns)]),
    };
    let mut channel = json!({
        "key": name,
        "label": label,
        "unit": unit,
        "scale": scale_name,
        "is_depth": depth.is_some_and(|depth| matches!(samples, Samples::F32(v) if std::ptr::eq(v.as_slice(), depth))),
        "words": words(name, samples),
        "packed": packed,
    });
    if let (Some(channel), Value::Object(more)) = (channel.as_object_mut(), more) {
        channel.extend(more);
    }
    Some(channel)
}

/// The words that the numbers of a channel stand for, by number, if they stand for words.
fn words(name: &str, samples: &Samples) -> Option<BTreeMap<u32, &'static str>> {
    let (Values::OfPixel { word, .. }, Samples::U32(numbers)) = (output::channel(name)?.values, samples)
    else {
        return None;
    };
    let seen: BTreeSet<u32> = numbers.iter().copied().collect();
    Some(seen.into_iter().filter_map(|number| Some((number, word(number)?))).collect())
}

pub(super) fn document(title: &str, body: &str) -> String {
    let hash = |text: &str| pack::base64(&hmac_sha256::Hash::hash(text.as_bytes()));
    let table = |colour: &dyn Fn(f64) -> [u8; 3]| -> String {
        pack::base64(&(0..256).flat_map(|i| colour(f64::from(i) / 255.0)).collect::<Vec<u8>>())
    };
    let turbo = table(&|part| {
        // The very ends of Turbo are nearly black, and would look like a miss.
        let colour = colorous::TURBO.eval_continuous(0.95 - 0.87 * part);
        [colour.r, colour.g, colour.b]
    });
    let viridis = table(&GroundMap::colour);
    let named = json!({
        "nothing": NO_RETURN_COLOUR,
        "same": colours::SAME,
        "less": colours::LESS,
        "more": colours::MORE,
        "vanished": colours::VANISHED,
        "appeared": colours::APPEARED,
        "unseen": GroundMap::UNSEEN,
    });
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src 'sha256-{}'; \
         style-src 'sha256-{}'; base-uri 'none'; form-action 'none'\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n<title>{title}</title>\n<style>{STYLE}</style>\n</head>\n\
         <body data-turbo=\"{turbo}\" data-viridis=\"{viridis}\" data-colours=\"{}\">\n<header><h1><bdi>{title}</bdi></h1>\
         <label>Theme <select id=\"theme\"><option value=\"\">as the system</option><option value=\"light\">light</option>\
         <option value=\"dark\">dark</option></select></label></header>\n\
         <noscript><p>The pictures and clouds of this page are drawn by a script, and scripts are turned off.</p></noscript>\n\
         <main>{body}</main>\n<script>{SCRIPT}</script>\n</body>\n</html>\n",
        hash(SCRIPT),
        hash(STYLE),
        escape(&named.to_string()),
        title = escape(title),
    )
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::output::Channel;

    const HOSTILE: &str = "</script><img src=x onerror=alert(1)> \u{202e}\u{7}\"'&";

    /// An image of 2 × 3 pixels, one of which has no return.
    pub fn view() -> View {
        let channel = |name: &str, samples| Channel { name: name.to_owned(), samples };
        let image = Image {
            rows: 2,
            columns: 3,
            channels: vec![
                channel("id.instance", Samples::U32(vec![0, 1, 1, 0, 0, 7])),
                channel("intensity", Samples::F32(vec![0.0, 0.5, 1.0, 0.0, 0.25, 0.125])),
                channel("range", Samples::F32(vec![1.0, 2.0, 3.0, f32::INFINITY, 5.0, 6.0])),
            ],
        };
        let points = (0..5).map(|i| [i as f32, 0.0, 1.0]).collect();
        let instances = BTreeMap::from([(1, HOSTILE.to_owned()), (2, "not seen".to_owned())]);
        View {
            name: HOSTILE.to_owned(),
            frame: None,
            image,
            points: Ok(points),
            instances,
            labels: BTreeMap::new(),
        }
    }

    fn shown(view: View) -> Shown {
        Shown { views: vec![view], rig: Rig::default() }
    }

    /// The data of a page's section.
    pub fn data(page: &str) -> Value {
        let (_, rest) = page.split_once("<script type=\"application/json\">").unwrap();
        serde_json::from_str(rest.split_once("</script>").unwrap().0).unwrap()
    }

    #[test]
    fn names_stay_text() {
        let page = of_views(HOSTILE, HOSTILE, &shown(view()));
        assert!(!page.contains("<img") && !page.contains('\u{202e}') && !page.contains('\u{7}'));
        // One script of data, and the page's own.
        assert_eq!((page.matches("<script").count(), page.matches("</script>").count()), (2, 2));
        let data = data(&page);
        assert_eq!(data["instances"]["1"], escaped(HOSTILE));
        assert_eq!(data["instances"].as_object().unwrap().len(), 1, "only what is seen is named");
        assert_eq!(escaped("שלום \u{202e}x\u{0}"), "שלום \\u{202e}x\\u{0}");
    }

    #[test]
    fn the_policy_allows_the_page_itself_and_nothing_else() {
        let page =
            of_views("a", "", &shown(View { name: "top".to_owned(), instances: BTreeMap::new(), ..view() }));
        let (_, policy) = page.split_once("Content-Security-Policy\" content=\"").unwrap();
        let policy = policy.split_once('"').unwrap().0;
        let parts: Vec<&str> = policy.split("; ").collect();
        assert_eq!(parts[0], "default-src 'none'");
        assert!(parts[1].starts_with("script-src 'sha256-") && parts[2].starts_with("style-src 'sha256-"));
        assert_eq!(parts[3..], ["base-uri 'none'", "form-action 'none'"]);
        // The text between the tags is hashed, so neither text may hold its own end tag.
        assert!(page.contains(&format!("<script>{SCRIPT}</script>")) && !SCRIPT.contains("</script"));
        assert!(page.contains(&format!("<style>{STYLE}</style>")) && !STYLE.contains("</style"));
        for forbidden in ["http:", "https:", "src=", " style=", "onclick", "url("] {
            assert!(!page.contains(forbidden), "{forbidden}");
        }
    }

    #[test]
    fn what_is_no_picture_is_no_picture() {
        let mut lone = view();
        (lone.image.rows, lone.image.columns) = (1, 6);
        assert!(!of_views("a", "", &shown(lone)).contains("canvas data-picture"));
        let mut dark = view();
        dark.points = Err("no beams".to_owned());
        let page = of_views("a", "", &shown(dark));
        assert!(
            page.contains("no beams")
                && !page.contains("class=\"cloud\"")
                && page.contains("data-picture=\"run\"")
        );
        assert_eq!(data(&page)["points"], Value::Null);
    }

    #[test]
    fn the_same_frames_give_the_same_page() {
        assert_eq!(of_views("a", "", &shown(view())), of_views("a", "", &shown(view())));
    }
}
