use std::path::Path;

use super::keys::GRAMMAR;
use super::kinds::{Choice, Nested, Number};
use super::table::{Grammar, Key, Reading, Table, TableKeys, key, table};
use super::{Document, parse, reference, schema, starter};
use crate::source::{Layer, Report, Span};

/// A made-up kind of file. Each of its keys is declared here and nowhere else.
static ROBOT: TableKeys = table("a robot", &[&ARM]);
static ARM: Key<Nested> = key("arm", Nested(&ARM_KEYS), "The robot's arm.");
static ARM_KEYS: TableKeys = table("`[arm]`", &[&REACH, &GRIP]);
static REACH: Key<Number> = key("reach_m", Number::POSITIVE, "How far the arm reaches, in metres.")
    .required("`reach_m = 1.5`")
    .starts_as("1.5");
static GRIP: Key<Choice<u8>> =
    key("grip", Choice(&[("firm", 1), ("soft", 2)]), "How the hand grips.").or("\"soft\"");

/// The result of reading a robot's arm, and the problems as `message | label | help`.
fn read(text: &str) -> (Option<f64>, Option<u8>, Vec<String>) {
    let grammar = Grammar::new(&[&ROBOT]);
    let mut report = Report::default();
    let source = report.add(Path::new("robot.toml"), text.to_owned(), Layer::Main);
    let entries = parse::parse(&report, source).unwrap();
    let reading = Reading { report: &report, grammar: &grammar };
    let robot = Table::new(reading, &ROBOT, &entries, Span::new(source, 0..0));
    let arm = robot.read(&ARM).unwrap().value;
    let (reach, grip) = (arm.read(&REACH), arm.read_or_default(&GRIP));
    let (reach, grip) = (reach.map(|reach| reach.value), grip.map(|grip| grip.value));
    drop((arm, robot));
    let told = report.into_diagnostics();
    let told =
        told.iter().map(|d| format!("{} | {} | {}", d.message, d.label, d.help.as_deref().unwrap_or("")));
    (reach, grip, told.collect())
}

#[test]
fn a_made_up_key_is_declared_once_and_is_everywhere() {
    // The reader, with the Rust types that the kinds determine.
    assert_eq!(read("arm = { reach_m = 2, grip = \"firm\" }"), (Some(2.0), Some(1), vec![]));
    assert_eq!(read("arm = { reach_m = 2 }"), (Some(2.0), Some(2), vec![]));

    // The errors: bounds, unit, words, suggestions, absence.
    let expect = |text: &str, told: &[&str]| assert_eq!(read(text).2, told, "{text}");
    expect(
        "arm = { reach_m = -1, grip = \"frim\" }",
        &[
            "`reach_m` is -1 | expected a number of metres, greater than 0 | ",
            "`grip` is the string \"frim\" | expected \"firm\" or \"soft\" | did you mean \"firm\"?",
        ],
    );
    expect(
        "arm = { reach_cm = 3 }",
        &["unknown key `reach_cm` in `[arm]` |  | did you mean `reach_m`, in metres?"],
    );
    expect("arm = {}", &["`[arm]` has no `reach_m` | needs `reach_m` | add `reach_m = 1.5`"]);

    // The schema.
    let schema = schema::document("robot", &ROBOT);
    let arm = &schema["properties"]["arm"];
    assert_eq!(
        arm["properties"]["reach_m"],
        serde_json::json!({
            "type": "number", "exclusiveMinimum": 0, "description": "How far the arm reaches, in metres.",
        })
    );
    assert_eq!(
        (&arm["required"][0], &arm["properties"]["grip"]["default"]),
        (&"reach_m".into(), &"soft".into())
    );

    // The reference page.
    let page = reference::page(&Grammar::new(&[&ROBOT]), "");
    let rows = "| `reach_m` | a number of metres, greater than 0 | an error | How far the arm reaches, in metres. |\n\
                | `grip` | `\"firm\"` or `\"soft\"` | `\"soft\"` | How the hand grips. |\n";
    assert!(page.contains(rows), "{page}");

    // The starter.
    let starter = starter::text(&ROBOT, &[]);
    assert_eq!(
        starter,
        "\n# The robot's arm.\n[arm]\n# How far the arm reaches, in metres.\nreach_m = 1.5\n"
    );
    assert_eq!(read(&starter), (Some(1.5), Some(2), vec![]));
}

#[test]
fn declarations_are_sound() {
    let report = Report::default();
    let mut titles = Vec::new();
    for table in &GRAMMAR.tables {
        assert!(!titles.contains(&table.title), "two tables are called {}", table.title);
        titles.push(table.title);
        for key in table.keys {
            let facts = key.facts();
            let name = format!("{} of {}", facts.name, table.title);
            assert!(facts.about.ends_with('.') && !facts.about.contains('|'), "{name}");
            let count = table.names().filter(|other| *other == facts.name).count();
            assert_eq!(count, 1, "{name} is declared {count} times");
            let is_declared =
                |other: &&str| GRAMMAR.tables.iter().any(|t| t.names().any(|known| known == *other));
            assert!(facts.replaces.iter().all(is_declared), "{name}");
            if let Some(example) = facts.required {
                assert!(example.contains(facts.name), "{name}: {example}");
            }
            // Defaults and starters are right values.
            let starter = facts.starter.map(|starter| starter.value());
            for text in facts.default.into_iter().chain(starter) {
                let node = parse::constant(text).unwrap_or_else(|| panic!("{name}: {text}"));
                let reading = Reading { report: &report, grammar: &GRAMMAR };
                assert!(key.allows(reading, &node), "{name}: {text}");
            }
        }
        let is_declared = |key: &&dyn super::table::AnyKey| table.names().any(|name| name == key.name());
        assert!(table.groups().flatten().all(is_declared), "{}", table.title);
    }
}

/// Whether a file of the project is what the program makes; `command` makes it.
fn assert_is_kept(path: &str, made: &str, command: &str) {
    let kept = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap_or_default();
    assert!(kept == made, "{path} is not what the program makes; make it again: {command} > {path}");
}

#[test]
fn the_files_for_editors_and_the_pages_of_keys_and_formats_are_kept() {
    for (name, document) in [("job", Document::Job), ("sensor", Document::Sensor)] {
        let made = format!("{:#}\n", super::schema(document));
        assert_is_kept(&format!("configs/schema/{name}.json"), &made, &format!("beamcast schema {name}"));
    }
    assert_is_kept("docs/keys.md", &super::reference(), "beamcast schema keys");
    assert_is_kept("docs/formats.md", &crate::output::formats_page(), "beamcast schema formats");
}

#[test]
fn the_starter_is_a_job() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("job.toml");
    let text = super::starter_job("a \"quoted\" scene\\.glb", "velodyne/vlp-16");
    std::fs::write(&path, &text).unwrap();
    let job = super::load_job(&path, &[]).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(job.scene_as_written, "a \"quoted\" scene\\.glb");
    assert_eq!(job.warnings, []);
    // Its suggestions are right, too.
    let all: Vec<_> = text
        .lines()
        .map(|line| line.strip_prefix('#').filter(|l| !l.starts_with([' ', ':'])).unwrap_or(line))
        .collect();
    std::fs::write(&path, all.join("\n")).unwrap();
    let job = super::load_job(&path, &[]).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((job.labels["wall"], job.sensors[0].sensor.range.max_m), (3, 50.0));
}
