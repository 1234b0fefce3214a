//! Outcomes as JUnit XML, for CI servers.

use std::io;

use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesText, Event};

use super::outcome::{Failure, Outcome, Verdict};

/// The elements of JUnit for a case that did not pass.
const FAILURE: &str = "failure";
const ERROR: &str = "error";

/// A test case: its name, and the element and the sentences that say why it did not pass. A case without sentences passed.
struct Case {
    name: String,
    element: &'static str,
    reasons: Vec<String>,
}

/// JUnit XML with a suite for each job, and in it a case for each sensor and each expectation.
pub fn xml(outcomes: &[Outcome]) -> String {
    let suites: Vec<_> = outcomes.iter().map(|outcome| (xml_text(&outcome.job), cases(outcome))).collect();
    let mut writer = Writer::new_with_indent(Vec::new(), b' ', 4);
    write_suites(&mut writer, &suites).expect("writing to memory does not fail");
    String::from_utf8(writer.into_inner()).expect("only strings were written")
}

fn cases(outcome: &Outcome) -> Vec<Case> {
    let mut cases = Vec::new();
    if !outcome.problems.is_empty() || (outcome.sensors.is_empty() && outcome.expectations.is_empty()) {
        let element = if outcome.verdict == Verdict::Broken { ERROR } else { FAILURE };
        cases.push(Case {
            name: "job".into(),
            element,
            reasons: outcome.problems.iter().map(Failure::located).collect(),
        });
    }
    cases.extend(outcome.sensors.iter().map(|sensor| Case {
        name: format!("{} is as in its baseline", sensor.title()),
        element: FAILURE,
        reasons: sensor.differences.iter().map(|difference| difference.sentence.clone()).collect(),
    }));
    cases.extend(outcome.expectations.iter().map(|expectation| Case {
        name: expectation.name.clone(),
        element: FAILURE,
        reasons: if expectation.met { vec![] } else { vec![expectation.sentence()] },
    }));
    cases
}

fn write_suites(writer: &mut Writer<Vec<u8>>, suites: &[(String, Vec<Case>)]) -> io::Result<()> {
    writer.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
    let all: Vec<&Case> = suites.iter().flat_map(|(_, cases)| cases).collect();
    writer
        .create_element("testsuites")
        .with_attribute(("name", "beamcast check"))
        .with_attribute(("tests", all.len().to_string().as_str()))
        .with_attribute(("skipped", "0"))
        .with_attribute(("failures", count(&all, FAILURE).as_str()))
        .with_attribute(("errors", count(&all, ERROR).as_str()))
        .write_inner_content(|writer| {
            suites.iter().try_for_each(|(job, cases)| write_suite(writer, job, cases))
        })?;
    writer.write_indent()
}

fn write_suite(writer: &mut Writer<Vec<u8>>, job: &str, cases: &[Case]) -> io::Result<()> {
    let all: Vec<&Case> = cases.iter().collect();
    writer
        .create_element("testsuite")
        .with_attribute(("name", job))
        .with_attribute(("tests", all.len().to_string().as_str()))
        .with_attribute(("skipped", "0"))
        .with_attribute(("errors", count(&all, ERROR).as_str()))
        .with_attribute(("failures", count(&all, FAILURE).as_str()))
        .write_inner_content(|writer| cases.iter().try_for_each(|case| write_case(writer, job, case)))?;
    Ok(())
}

fn write_case(writer: &mut Writer<Vec<u8>>, job: &str, case: &Case) -> io::Result<()> {
    let name = xml_text(&case.name);
    let element = writer
        .create_element("testcase")
        .with_attribute(("name", name.as_str()))
        .with_attribute(("classname", job));
    let Some(first) = case.reasons.first() else {
        element.write_empty()?;
        return Ok(());
    };
    element.write_inner_content(|writer| {
        let text = xml_text(&case.reasons.join("\n"));
        writer
            .create_element(case.element)
            .with_attribute(("message", xml_text(first).as_str()))
            .write_text_content(BytesText::new(&text))?;
        Ok(())
    })?;
    Ok(())
}

/// The number of cases that did not pass in the way that `element` names.
fn count(cases: &[&Case], element: &str) -> String {
    cases.iter().filter(|case| case.element == element && !case.reasons.is_empty()).count().to_string()
}

/// The text with U+FFFD in place of each character that XML 1.0 cannot represent (its section 2.2, `Char`). Names come from
/// files, and one such character would make the whole report unreadable.
fn xml_text(text: &str) -> String {
    let allowed = |c: char| matches!(c, '\t' | '\n' | '\r' | ' '..='\u{FFFD}' | '\u{10000}'..);
    text.chars().map(|c| if allowed(c) { c } else { char::REPLACEMENT_CHARACTER }).collect()
}

#[cfg(test)]
mod tests {
    use super::super::{Difference, ExpectationOutcome, SensorOutcome};
    use super::*;

    fn difference(sentence: &str) -> Difference {
        Difference { sentence: sentence.into(), ..Difference::default() }
    }

    fn outcome() -> Outcome {
        let sensor = |name: &str, differences: &[&str]| SensorOutcome {
            name: name.into(),
            differences: differences.iter().map(|d| difference(d)).collect(),
            ..SensorOutcome::default()
        };
        let expectation = ExpectationOutcome {
            name: "a, b: c".into(),
            met: false,
            expected: "at least 5 points on \"x|y\"".into(),
            found: "1 point".into(),
            ..ExpectationOutcome::default()
        };
        Outcome {
            job: "a,b.toml".into(),
            verdict: Verdict::Failed,
            sensors: vec![
                sensor("roof", &["3 ranges differ, 50 % <&> more", "and so on"]),
                sensor("left", &[]),
            ],
            expectations: vec![expectation],
            ..Outcome::default()
        }
    }

    #[test]
    fn the_report_has_a_suite_for_each_job_and_a_case_for_each_claim() {
        let broken = Outcome {
            job: "broken.toml".into(),
            verdict: Verdict::Broken,
            problems: vec!["no such file".to_owned().into()],
            ..Outcome::default()
        };
        let good = Outcome { job: "good.toml".into(), ..Outcome::default() };
        let expected = r#"<?xml version="1.0" encoding="UTF-8"?>
<testsuites name="beamcast check" tests="5" skipped="0" failures="2" errors="1">
    <testsuite name="a,b.toml" tests="3" skipped="0" errors="0" failures="2">
        <testcase name="sensor roof is as in its baseline" classname="a,b.toml">
            <failure message="3 ranges differ, 50 % &lt;&amp;&gt; more">3 ranges differ, 50 % &lt;&amp;&gt; more
and so on</failure>
        </testcase>
        <testcase name="sensor left is as in its baseline" classname="a,b.toml"/>
        <testcase name="a, b: c" classname="a,b.toml">
            <failure message="a, b: c: expected at least 5 points on &quot;x|y&quot;, found 1 point">a, b: c: expected at least 5 points on &quot;x|y&quot;, found 1 point</failure>
        </testcase>
    </testsuite>
    <testsuite name="broken.toml" tests="1" skipped="0" errors="1" failures="0">
        <testcase name="job" classname="broken.toml">
            <error message="no such file">no such file</error>
        </testcase>
    </testsuite>
    <testsuite name="good.toml" tests="1" skipped="0" errors="0" failures="0">
        <testcase name="job" classname="good.toml"/>
    </testsuite>
</testsuites>
"#;
        assert_eq!(xml(&[outcome(), broken, good]), expected);
    }

    #[test]
    fn characters_that_xml_lacks_are_replaced_everywhere() {
        let bad = "\0\u{1b}[31m\u{FFFE}\u{FFFF}\u{10FFFF}é";
        let mut outcome = outcome();
        outcome.job = bad.into();
        outcome.sensors[0].name = bad.into();
        outcome.sensors[0].differences = vec![difference(bad)];
        let xml = xml(&[outcome]);
        let written = "\u{FFFD}\u{FFFD}[31m\u{FFFD}\u{FFFD}\u{10FFFF}é";
        assert_eq!(xml.matches(written).count(), 7, "{xml}"); // the suite, three classes, a name, a message and a text
        assert!(!xml.contains(['\0', '\u{1b}', '\u{FFFE}', '\u{FFFF}']));
    }
}
