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

use super::frames::View;
use super::pack;
use crate::check::phrasing::digits;
use crate::check::{Change, ExpectationOutcome, Outcome, SensorOutcome, Verdict};
use crate::output::{self, Channel, DEPTH_FOR_OPENCV, Image, NO_RETURN_M, Samples, Scale, Values};
use crate::source::suggest::escaped;

const SCRIPT: &str = include_str!("page.js");
const STYLE: &str = include_str!("page.css");

/// The largest picture that every browser draws, in pixels each way.
const MAX_PICTURE: usize = 16_384;

/// The page that shows frames, with a note above them, which may be empty.
pub fn of_views(title: &str, note: &str, views: &[View]) -> String {
    let mut body = String::new();
    if !note.is_empty() {
        let _ = write!(body, "<p>{}</p>", escape(note));
    }
    for view in views {
        body += &section(view, None);
    }
    document(title, &body)
}

/// The page of a check. `views` has the frames of each outcome's sensors, and none for a job that could not be run.
pub fn of_outcomes(outcomes: &[Outcome], views: &[Vec<View>]) -> String {
    let failed = outcomes.iter().filter(|o| !o.verdict.is_fine()).count();
    let mut body = String::new();
    let said = match (outcomes.len(), failed) {
        (1, 0) => "The job passed.".to_owned(),
        (1, _) => "The job failed.".to_owned(),
        (jobs, 0) => format!("All {jobs} jobs passed."),
        (jobs, failed) => format!("{failed} of {jobs} jobs failed."),
    };
    let _ = write!(body, "<p class=\"lead\">{said}</p>");
    if outcomes.len() > 1 {
        let rows = outcomes.iter().enumerate().map(|(i, o)| {
            vec![
                Cell::Link(format!("#job{i}"), o.job.clone()),
                Cell::Verdict(o.verdict.is_fine(), verdict(o.verdict)),
                Cell::Text(met(&o.expectations)),
            ]
        });
        body += &table("Jobs", &["job", "verdict", "expectations met"], rows);
    }
    for (index, outcome) in outcomes.iter().enumerate() {
        let _ = write!(
            body,
            "<section id=\"job{index}\" class=\"job\"><h2><bdi>{}</bdi> <span class=\"verdict {}\">{}</span></h2>",
            escape(&outcome.job),
            if outcome.verdict.is_fine() { "good" } else { "bad" },
            verdict(outcome.verdict)
        );
        body += &sentences(&outcome.problems);
        let differences = outcome.sensors.iter().flat_map(|s| s.differences.iter().cloned());
        body += &sentences(&differences.collect::<Vec<_>>());
        body += &expectations(&outcome.expectations);
        body += &changes(&outcome.changes);
        body += &statistics(&outcome.sensors);
        for view in views.get(index).into_iter().flatten() {
            body += &section(view, outcome.sensors.iter().find(|sensor| sensor.name == view.name));
        }
        body += "</section>";
    }
    document("beamcast check", &body)
}

fn verdict(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Passed => "passed",
        Verdict::Accepted => "accepted",
        Verdict::Failed => "failed",
        Verdict::Broken => "could not be run",
    }
}

fn met(expectations: &[ExpectationOutcome]) -> String {
    match expectations.len() {
        0 => "none made".to_owned(),
        all => format!("{} of {all}", expectations.iter().filter(|e| e.met).count()),
    }
}

fn sentences(all: &[String]) -> String {
    if all.is_empty() {
        return String::new();
    }
    let items = all.iter().map(|s| format!("<li><bdi>{}</bdi></li>", escape(s)));
    format!("<ul class=\"sentences\">{}</ul>", items.collect::<String>())
}

fn expectations(all: &[ExpectationOutcome]) -> String {
    if all.is_empty() {
        return String::new();
    }
    let rows = all.iter().map(|e| {
        let text = |text: &str| Cell::Text(text.to_owned());
        let verdict = Cell::Verdict(e.met, if e.met { "met" } else { "not met" });
        vec![text(&e.name), verdict, text(&e.expected), text(&e.found), text(&e.place)]
    });
    table("Expectations", &["name", "", "expected", "found", "where"], rows)
}

fn changes(all: &[Change]) -> String {
    if all.is_empty() {
        return String::new();
    }
    let value = |value: &Option<String>| match value {
        Some(value) => Cell::Code(value.clone()),
        None => Cell::Text("not there".to_owned()),
    };
    let rows = all.iter().map(|c| vec![Cell::Code(c.subject()), value(&c.old), value(&c.new)]);
    table("Changed since the baseline was accepted", &["what", "was", "is"], rows)
}

fn statistics(sensors: &[SensorOutcome]) -> String {
    let number = |x: f64| Cell::Number(digits(x));
    let rows: Vec<Vec<Cell>> = sensors
        .iter()
        .flat_map(|sensor| sensor.channels.iter().map(move |channel| (sensor, channel)))
        .map(|(sensor, c)| {
            let least = if c.differing.exact { "" } else { "at least " };
            let mut row = vec![
                Cell::Text(sensor.name.clone()),
                Cell::Code(c.channel.clone()),
                Cell::Number(format!("{least}{}", c.differing.count)),
            ];
            row.extend(match c.statistics {
                Some(s) => [s.max, s.mean, s.rms, s.p99].map(number),
                None => [(); 4].map(|()| Cell::Number("–".to_owned())),
            });
            row.push(Cell::Verdict(c.within_tolerance, if c.within_tolerance { "yes" } else { "no" }));
            row
        })
        .collect();
    if rows.is_empty() {
        return String::new();
    }
    let head = ["sensor", "channel", "pixels that differ", "max", "mean", "RMS", "99 %", "within tolerance"];
    table("Differences from the baseline", &head, rows)
}

enum Cell {
    Text(String),
    Code(String),
    Number(String),
    Link(String, String),
    Verdict(bool, &'static str),
}

fn table(caption: &str, head: &[&str], rows: impl IntoIterator<Item = Vec<Cell>>) -> String {
    let mut html =
        format!("<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"{caption}\"><table>");
    let _ = write!(html, "<caption>{caption}</caption><thead><tr>");
    for name in head {
        let _ = write!(html, "<th scope=\"col\">{name}</th>");
    }
    html += "</tr></thead><tbody>";
    for row in rows {
        html += "<tr>";
        for cell in row {
            let _ = match cell {
                Cell::Text(text) => write!(html, "<td><bdi>{}</bdi></td>", escape(&text)),
                Cell::Code(text) => write!(html, "<td><code><bdi>{}</bdi></code></td>", escape(&text)),
                Cell::Number(text) => write!(html, "<td class=\"number\">{}</td>", escape(&text)),
                Cell::Link(to, text) => {
                    write!(html, "<td><a href=\"{to}\"><bdi>{}</bdi></a></td>", escape(&text))
                }
                Cell::Verdict(good, text) => {
                    let class = if good { "good" } else { "bad" };
                    write!(html, "<td><span class=\"verdict {class}\">{text}</span></td>")
                }
            };
        }
        html += "</tr>";
    }
    html + "</tbody></table></div>"
}

/// The section of a frame: controls, pictures, cloud, and the numbers behind them. The script fills it when it comes into
/// sight. `compared` is the outcome of comparing the frame with its baseline.
fn section(view: &View, compared: Option<&SensorOutcome>) -> String {
    let name = escape(&view.name);
    let image = &view.image;
    let baseline = compared.and_then(|sensor| sensor.baseline.as_ref());
    let resolution = |channel: &str| {
        let all = compared.map_or(&[][..], |sensor| &sensor.channels);
        all.iter().find(|c| c.channel == channel).map_or(0.0, |c| c.resolution)
    };
    let (rows, columns) = (image.rows, image.columns);
    let fits = rows <= MAX_PICTURE && columns <= MAX_PICTURE;
    let is_picture = fits && rows > 1 && columns > 1;
    let (size, stretch) = (format!("{rows} × {columns}"), stretch(image));
    let wide = columns > 2 * rows * stretch;
    let mut pictures = String::new();
    if is_picture {
        let mut captions = vec!["run"];
        if baseline.is_some() {
            captions = vec!["baseline", "run", "difference"];
        }
        let class = if wide { "pictures wide" } else { "pictures" };
        let _ = write!(pictures, "<div class=\"{class}\">");
        for caption in &captions {
            let shown = if captions.len() == 1 {
                String::new()
            } else {
                format!("<figcaption>{caption}</figcaption>")
            };
            let _ = write!(
                pictures,
                "<figure>{shown}<div class=\"picture\"><canvas data-picture=\"{caption}\" tabindex=\"0\" role=\"img\" \
                 aria-label=\"{name}, {caption}: range image of {size} pixels. Arrow keys move from pixel to pixel.\">\
                 </canvas><div class=\"marker\" hidden></div></div></figure>"
            );
        }
        pictures += "</div><p class=\"hint\">Point at a pixel, or move with the arrow keys (Shift: by ten).</p>\
                     <output class=\"values\"></output>";
    } else if rows > 1 {
        let _ =
            write!(pictures, "<p class=\"hint\">An image of {size} pixels is too large for a picture.</p>");
    }
    let cloud = match &view.points {
        Ok(points) => format!(
            "<canvas class=\"cloud\" tabindex=\"0\" role=\"application\" aria-label=\"{name}: cloud of {} points. Arrow keys \
             turn it, plus and minus zoom, Shift with arrow keys moves it, 0 shows all again.\"></canvas>\
             <p class=\"hint cloud-hint\">Drag to turn, wheel or two fingers to zoom, Shift-drag or right button to move; arrow keys, \
             + and −, 0 for the whole. Axes: x forward red, y left green, z up blue, one metre each.</p>\
             <p class=\"hint no-webgl\" hidden>This browser shows no WebGL2, so there is no cloud to turn here. \
             The pictures do not need it.</p>",
            points.len()
        ),
        Err(why) => format!("<p class=\"hint\">{}</p>", escape(why)),
    };
    let data = json!({
        "rows": rows,
        "columns": columns,
        "stretch": stretch,
        "channels": channels(image, &|_| 0.0),
        "baseline": baseline.map(|image| channels(image, &resolution)),
        "points": view.points.as_ref().ok().map(|points| pack::points(points)),
        "instances": names_of_seen(view, baseline),
    });
    format!(
        "<section class=\"view\" aria-label=\"{name}\" aria-busy=\"true\"><h3><bdi>{name}</bdi> <small>{}</small></h3>\
         <div class=\"controls\"></div>{pictures}<div class=\"legend\"></div>{cloud}\
         <script type=\"application/json\">{}</script></section>",
        if rows > 1 { format!("{size} pixels") } else { format!("{columns} points") },
        // Inside a script element, only `<` can end the element or begin a comment.
        data.to_string().replace('<', "\\u003c")
    )
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

fn names_of_seen(view: &View, baseline: Option<&Image>) -> BTreeMap<u32, String> {
    let images = [Some(&view.image), baseline];
    let ids = images.into_iter().flatten().filter_map(|image| image.u32("id.instance")).flatten();
    let seen: BTreeSet<u32> = ids.copied().collect();
    let name = |id| view.instances.get(&id).filter(|name| !name.is_empty()).map(|name| (id, escaped(name)));
    seen.into_iter().filter_map(name).collect()
}

/// The channels in the order in which people ask for them, each with the settings by which the script shows it.
fn channels(image: &Image, resolution: &dyn Fn(&str) -> f64) -> Value {
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
        .filter_map(|(_, Channel { name, samples })| channel(image, name, samples, depth, resolution));
    Value::Array(all.collect())
}

fn channel(
    image: &Image,
    name: &str,
    samples: &Samples,
    depth: Option<&[f32]>,
    resolution: &dyn Fn(&str) -> f64,
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
    Some(json!({
        "key": name,
        "label": label,
        "unit": unit,
        "scale": scale_name,
        "is_depth": depth.is_some_and(|depth| matches!(samples, Samples::F32(v) if std::ptr::eq(v.as_slice(), depth))),
        "resolution": resolution(name),
        "words": words(name, samples),
        "packed": packed,
    }))
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

fn document(title: &str, body: &str) -> String {
    let hash = |text: &str| pack::base64(&hmac_sha256::Hash::hash(text.as_bytes()));
    let turbo: Vec<u8> = (0..256)
        .flat_map(|i| {
            // The very ends of Turbo are nearly black, and would look like a miss.
            let colour = colorous::TURBO.eval_continuous(0.95 - 0.87 * f64::from(i) / 255.0);
            [colour.r, colour.g, colour.b]
        })
        .collect();
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src 'sha256-{}'; \
         style-src 'sha256-{}'; base-uri 'none'; form-action 'none'\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n<title>{title}</title>\n<style>{STYLE}</style>\n</head>\n\
         <body data-turbo=\"{}\">\n<header><h1><bdi>{title}</bdi></h1>\
         <label>Theme <select id=\"theme\"><option value=\"\">as the system</option><option value=\"light\">light</option>\
         <option value=\"dark\">dark</option></select></label></header>\n\
         <noscript><p>The pictures and clouds of this page are drawn by a script, and scripts are turned off.</p></noscript>\n\
         <main>{body}</main>\n<script>{SCRIPT}</script>\n</body>\n</html>\n",
        hash(SCRIPT),
        hash(STYLE),
        pack::base64(&turbo),
        title = escape(title),
    )
}

/// Writes text for HTML, in content and in attributes. Characters that control, which HTML can't have or which turn the text
/// after them around, are shown by their codes, as in messages. Scripts that are written from the right need none of them:
/// `<bdi>` keeps their names apart.
fn escape(text: &str) -> String {
    let mut html = String::with_capacity(text.len());
    for c in escaped(text).chars() {
        match c {
            '&' => html += "&amp;",
            '<' => html += "&lt;",
            '>' => html += "&gt;",
            '"' => html += "&quot;",
            '\'' => html += "&#39;",
            c => html.push(c),
        }
    }
    html
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::Channel;

    const HOSTILE: &str = "</script><img src=x onerror=alert(1)> \u{202e}\u{7}\"'&";

    /// An image of 2 × 3 pixels, one of which has no return.
    fn view() -> View {
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
        View { name: HOSTILE.to_owned(), image, points: Ok(points), instances }
    }

    /// The data of a page's section.
    fn data(page: &str) -> Value {
        let (_, rest) = page.split_once("<script type=\"application/json\">").unwrap();
        serde_json::from_str(rest.split_once("</script>").unwrap().0).unwrap()
    }

    #[test]
    fn names_stay_text() {
        let page = of_views(HOSTILE, HOSTILE, &[view()]);
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
            of_views("a", "", &[View { name: "top".to_owned(), instances: BTreeMap::new(), ..view() }]);
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
    fn a_check_tells_verdict_changes_expectations_and_differences() {
        let mut run = view();
        run.name = "top".to_owned();
        let sensor = SensorOutcome {
            name: "top".to_owned(),
            differences: vec!["sensor top: 1 of 6 ranges differs".to_owned()],
            channels: vec![crate::check::compare::ChannelDifference {
                channel: "range".to_owned(),
                resolution: 0.25,
                ..Default::default()
            }],
            baseline: Some(run.image.clone()),
            ..SensorOutcome::default()
        };
        let change =
            Change { sensor: None, what: "seed <i>".to_owned(), old: Some("1".to_owned()), new: None };
        let expectation = ExpectationOutcome {
            name: "enough".to_owned(),
            met: false,
            expected: "at least 7 points".to_owned(),
            found: "5 points".to_owned(),
            place: "sensor top".to_owned(),
        };
        let outcome = Outcome {
            job: "a.toml".to_owned(),
            verdict: Verdict::Failed,
            changes: vec![change],
            sensors: vec![sensor],
            expectations: vec![expectation],
            ..Outcome::default()
        };
        let broken = Outcome {
            job: "b.toml".to_owned(),
            verdict: Verdict::Broken,
            problems: vec!["there is no scene".to_owned()],
            ..Outcome::default()
        };
        let page = of_outcomes(&[outcome, broken], &[vec![run], vec![]]);
        for part in [
            "2 of 2 jobs failed.",
            "a.toml</bdi> <span class=\"verdict bad\">failed",
            "could not be run",
            "there is no scene",
            "1 of 6 ranges differs",
            "seed &lt;i&gt;",
            "not there",
            "at least 7 points",
            "not met",
            "data-picture=\"baseline\"",
            "data-picture=\"difference\"",
        ] {
            assert!(page.contains(part), "{part}");
        }
        let data = data(&page);
        let range = data["baseline"].as_array().unwrap().iter().find(|c| c["key"] == "range").unwrap();
        assert_eq!((&range["resolution"], &range["is_depth"]), (&json!(0.25), &json!(true)));
    }

    #[test]
    fn what_is_no_picture_is_no_picture() {
        let mut lone = view();
        (lone.image.rows, lone.image.columns) = (1, 6);
        assert!(!of_views("a", "", &[lone]).contains("canvas data-picture"));
        let mut dark = view();
        dark.points = Err("no beams".to_owned());
        let page = of_views("a", "", &[dark]);
        assert!(
            page.contains("no beams")
                && !page.contains("class=\"cloud\"")
                && page.contains("data-picture=\"run\"")
        );
        assert_eq!(data(&page)["points"], Value::Null);
    }

    #[test]
    fn the_same_frames_give_the_same_page() {
        assert_eq!(of_views("a", "", &[view()]), of_views("a", "", &[view()]));
    }
}
