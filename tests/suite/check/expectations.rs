//! `[[expect]]`: what is met, what was found instead, and how mistakes in it are told.

use super::*;

#[test]
fn every_expectation_is_met_or_says_what_was_found_and_where() {
    let copy = Copy::room();
    fs::remove_dir_all(copy.path("configs/room_vlp16.baseline")).unwrap();
    let expect = |kind: &str, good: &str, bad: &str| {
        format!(
            "\n[[expect]]\nname = \"good {kind}\"\n{kind} = {good}\n[[expect]]\nname = \"bad {kind}\"\n{kind} = {bad}\n"
        )
    };
    let text = [
        expect(
            "points",
            "{ object = \"pillar\", at_least = 1, max_range_m = 20.0 }",
            "{ label = 4000000000, at_least = 1 }",
        ),
        expect(
            "plane",
            "{ object = \"floor\", normal = [0, 0, 2], offset_m = 0.0, max_error_m = 1e-6 }",
            "{ object = \"floor\", normal = [0, 0, 1], offset_m = 0.01, max_error_m = 1e-6 }",
        ),
        expect(
            "resolution",
            "{ object = \"pill*\", max_horizontal_deg = 0.21, max_vertical_deg = 2.01 }",
            "{ object = \"pillar\", max_horizontal_deg = 0.19 }",
        ),
        expect(
            "coverage",
            "{ x_m = [4.0, 5.0], y_m = [-0.5, 0.5], cell_m = 1.0, at_least = 0.0, ground_z_m = 0.0 }",
            "{ x_m = [-0.5, 0.5], y_m = [-0.5, 0.5], cell_m = 0.5, at_least = 0.1 }",
        ),
        expect(
            "blind_zone",
            "{ at_most_m = 4.479, sector_deg = { from = 0, to = 1 } }",
            "{ at_most_m = 4.478, sector_deg = { from = 0, to = 1 } }",
        ),
        expect("returns", "{ at_least = 1.0 }", "{ at_most = 0.5 }"),
        expect("unobstructed", "{ object = \"pillar\", at_most = 0.5 }", "{ object = \"walls*\" }"),
        expect("points_per_s", "{ at_least = 288000, at_most = 288000 }", "{ at_least = 288001 }"),
        expect("speed", "{ at_least_rays_per_s = 1.0 }", "{ at_least_rays_per_s = 1e15 }"),
    ]
    .concat();
    copy.append(ROOM, &text);
    let (code, out, err) = copy.run(&["check", "configs", "--json", "-"]);
    assert_eq!(code, 1, "{err}");
    let json: Value = serde_json::from_str(&out).unwrap();
    let found = json["jobs"][0]["expectations"].as_array().unwrap();
    assert_eq!(found.len(), 18);
    for expectation in found {
        let is_good = expectation["name"].as_str().unwrap().starts_with("good");
        assert_eq!(expectation["met"], is_good, "{expectation}");
    }
    has(
        &err,
        &[
            "bad points: expected at least 1 point on label 4000000000, found 0 points",
            "bad plane: expected \"floor\" within 0.001 mm of the plane",
            "points are further off, the worst by ",
            "bad resolution: expected beams on \"pillar\" at most 0.19° from column to column apart, found 0.2°",
            "bad coverage: expected ground seen in at least 10 % of the cells",
            "found 0 % of 4 cells (the nearest cell unseen is at (-0.25, -0.25) m)",
            // The lowest beam meets the ground at 1.2 m / tan 15° = 4.4785 m.
            "bad blind_zone: expected ground seen from a distance of 4.48 m on, found the ground begins at 4.48 m \
             (azimuth 0° to 1°)",
            "bad returns: expected at most 50 % of the rays return, found 100 % of the rays return (sensor vlp16)",
            "bad unobstructed: expected at most 0 % of the rays hit \"walls*\"",
            "(sensor vlp16: azimuth -179.8° to 180.0°, elevation -15.0° to 15.0°)",
            "bad points_per_s: expected at least 288001 points a second, found 288000 points a second",
            "bad speed: expected at least 1000000000000000 rays cast a second",
        ],
    );
}

#[test]
fn mistakes_in_check_and_expect_are_told_all_at_once() {
    let copy = Copy::room();
    copy.append(
        ROOM,
        "\n[check]\nchannels = [\"rnage\"]\ntolerance = { intensty = 1, range = -1, time = { pixels = 2 } }\n\
         [[expect]]\nname = \"a\"\nsensor = \"vlp61\"\npoints = { objct = \"x\" }\n\
         [[expect]]\nname = \"a\"\nreturns = { at_least = 0.9, at_most = 0.1 }\nspeed = {}\n\
         [[expect]]\ncoverage = { x_m = [1, 0], y_m = [0, 1], cell_m = 0.1, at_least = 90 }\n\
         [[expect]]\nname = \"c\"\nplane = { normal = [0, 0, 0], offset_m = 0, max_error_m = 1 }\n",
    );
    let (code, _, err) = copy.run(&["check", "configs"]);
    assert_eq!(code, 2);
    has(
        &err,
        &[
            "`channels` has the string \"rnage\"",
            "did you mean \"range\"?",
            "there is no channel `intensty`",
            "did you mean `intensity`?",
            "`range` is -1",
            "expected a number, 0 or more",
            "`pixels` is 2",
            "there is no sensor `vlp61`",
            "did you mean `vlp16`?",
            "unknown key `objct` in `points`",
            "`points` has no `at_least`",
            "two expectations are called `a`",
            "an expectation is about one thing",
            "`[[expect]]` has no `name`",
            "nothing lies between 1 and 0",
            "expected a part of the whole, from 0 to 1",
            "a plane's normal has no length",
        ],
    );
}
