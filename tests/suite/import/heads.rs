//! Calibrations of Hesai's and RoboSense's turning heads: the variants of their files, and the formulas of their drivers.

use std::time::{Duration, Instant};

use beamcast::sensor::{Beam, Capture, Sensor};
use glam::DVec3;

use super::{after_column_s, check_points, corpus, imported, own, rotating, sensor, toml};

/// The numbers, elevations and azimuth corrections of the channels, by channel.
fn hesai_angles(text: &str) -> Vec<[f64; 3]> {
    let rows = text.trim_start_matches('\u{feff}').lines().skip(1).filter(|line| !line.trim().is_empty());
    let mut rows: Vec<[f64; 3]> = rows
        .map(|line| {
            line.split(',').map(|x| x.trim().parse().unwrap()).collect::<Vec<_>>().try_into().unwrap()
        })
        .collect();
    rows.sort_by(|a, b| a[0].total_cmp(&b[0]));
    rows
}

fn check_hesai(text: &str, sensor: &Sensor) {
    let angles = hesai_angles(text);
    check_points(sensor, |channel, azimuth, r| {
        // The manual's y axis points forward, and its azimuths are clockwise.
        let [_, elevation, correction] = angles[channel];
        let (a, e) = (-azimuth + correction.to_radians(), elevation.to_radians());
        let x = r * libm::cos(e) * libm::sin(a);
        let y = r * libm::cos(e) * libm::cos(a);
        DVec3::new(y, -x, r * libm::sin(e))
    });
}

/// The times of the pulses of a column after its own time in microseconds, by channel; `None` for a channel that is silent.
fn times_us(sensor: &Sensor, column: usize) -> Vec<Option<f64>> {
    let pattern = rotating(sensor);
    let capture = Capture::at_origin(sensor);
    let of_row = |(row, beam): (usize, &Beam)| {
        let pulse = capture.pulse(row, column);
        let us = pulse.map(|pulse| (after_column_s(pattern, &pulse, column) * 1e12).round() / 1e6);
        (beam.file_index, us)
    };
    let mut times: Vec<_> = pattern.beams().iter().enumerate().map(of_row).collect();
    times.sort_by_key(|(index, _)| *index);
    times.into_iter().map(|(_, us)| us).collect()
}

/// Firing times count from the block's time as in the file (the case hesai_firetime_origin), and columns take turns.
#[test]
fn hesai_corrections_give_the_points_of_the_manual() {
    let angles = own("hesai_angles.csv");
    check_hesai(&angles, &imported(&angles));
    let loops =
        "laser_id,loop0_firetime,loop1_firetime\n0,46.645,46.645\n1,34.067,-\n2,18.867,21.011\n3,0.0,0.0\n";
    let nanoseconds = "Channel,fire time(ns)\n4,-3620\n2,-9500\n1,-3620\n3,-16040\n";
    let in_order = [Some(-3.62), Some(-9.5), Some(-16.04), Some(-3.62)];
    for (times, columns) in [
        (own("hesai_firetimes.csv"), vec![in_order]),
        (nanoseconds.to_owned(), vec![in_order]),
        // The azimuth states of operational state 0.
        (
            own("hesai_states.csv"),
            vec![[None, Some(6.289), Some(0.0), None], [Some(18.867), None, Some(21.011), Some(0.5)]],
        ),
        // Nanoseconds, of which 0 is silence, and of which the first column is that of far targets.
        (
            own("hesai_modes.csv"),
            vec![[Some(4.436), None, None, Some(2.431)], [Some(5.201), Some(0.776), Some(2.781), None]],
        ),
        (
            own("hesai_loops.csv"),
            vec![[Some(1.456), None, Some(0.6), None], [Some(0.9), Some(1.456), None, Some(2.312)]],
        ),
        // Channels that count from 0.
        (
            loops.to_owned(),
            vec![
                [Some(46.645), Some(34.067), Some(18.867), Some(0.0)],
                [Some(46.645), None, Some(21.011), Some(0.0)],
            ],
        ),
    ] {
        let sensor = sensor(&toml(&angles, Some(&times)).unwrap_or_else(|e| panic!("{e:#?}")));
        check_hesai(&angles, &sensor);
        for (column, expected) in columns.iter().cycle().take(2 * columns.len()).enumerate() {
            assert_eq!(times_us(&sensor, column), expected, "{times}, column {column}");
        }
    }
}

/// The variants that exist (the case hesai_hash_line): a hash at the end, a version at the beginning, other names of columns.
#[test]
fn hesai_corrections_of_newer_units_are_read() {
    let angles = own("hesai_angles.csv");
    let expected = toml(&angles, None).unwrap();
    let body = angles.trim_start_matches('\u{feff}').trim_end().split_once('\n').unwrap().1;
    let hash = "5f".repeat(32);
    for text in [
        format!("Channel,Elevation,Azimuth\n{body}\n{hash}\n"),
        format!("Channel,Elevation,Azimuth\n{body}\n{hash},,\n"),
        format!("LaserID,Elevation,Azimuth\n{body}\n"),
        format!("Laser id,Elevation(deg),Azimuth(deg)\n{body}\n"),
        format!("EEFF,1,1\nLaser id,Elevation,Azimuth\n{body}\n{hash}\n"),
    ] {
        assert_eq!(toml(&text, None).unwrap_or_else(|e| panic!("{text}: {e:#?}")), expected, "{text}");
    }
    // A hash stands at the end only, and has 64 digits.
    for wrong in
        [format!("Channel,Elevation,Azimuth\n{hash}\n{body}\n"), format!("{angles}\n{}\n", &hash[1..])]
    {
        assert_eq!(toml(&wrong, None).unwrap_err()[0].message, "the line has 1 field");
    }
    let times = own("hesai_firetimes.csv") + &hash + "\n";
    assert!(toml(&angles, Some(&times)).is_ok());
    let nanoseconds = own("hesai_firetimes.csv").replace("-16.04", "-16040");
    let found = toml(&angles, Some(&nanoseconds)).unwrap_err();
    assert!(found[0].message.contains("16040 µs"), "{found:?}");
    assert!(found[0].help.as_ref().unwrap().contains("(ns)"));
    let unnamed = own("hesai_firetimes.csv").replace("fire time(μs)", "fire time");
    assert!(toml(&angles, Some(&unnamed)).unwrap().contains("names no unit"));
}

/// The table of AT128 is that of a sector of 120 degrees. The numbers are in the pattern of PandarAT128.csv of tier4/nebula.
#[test]
fn the_table_of_an_at128_is_no_full_turn() {
    let mut text = "Channel,Elevation,Azimuth\n".to_owned();
    for channel in 0..128 {
        let azimuth = [[2.4, -0.65], [-2.4, 0.65]][channel / 16 % 2][channel % 2];
        text += &format!("{},{:.2},{azimuth}\n", channel + 1, 12.93 - 0.2 * channel as f64);
    }
    let made = toml(&text, None).unwrap();
    assert!(made.contains("AT128") && made.contains("120 degrees"), "{made}");
    let sensor = sensor(&made);
    let (from, to) = rotating(&sensor).sector();
    assert!((from.degrees() - 60.0).abs() < 1e-9 && (to.degrees() + 60.0).abs() < 1e-9);
    assert!((rotating(&sensor).azimuth_step().degrees() + 0.1).abs() < 1e-9);
}

/// A file of loops has as many cells as bytes allow, in rows of any width (the case import-hesai-loops-quadratic).
#[test]
fn loops_take_time_by_their_cells() {
    let start = Instant::now();
    let wide = "1,0.5,".repeat(200_000);
    let many = "0,0\n".repeat(200_000);
    let times = format!("EEFF,1\nx\nLoop1,x\n{many}{wide}\n{many}");
    let found = toml("Channel,Elevation,Azimuth\n1,1.0,0.0\n", Some(&times)).unwrap_err();
    assert_eq!(found[0].message, "the file has 17 loops or more");
    let silent = format!("EEFF,1\nx\nLoop1,x\n{many}{}\n{many}1,0.5\n", "0,0,".repeat(200_000));
    assert!(toml("Channel,Elevation,Azimuth\n1,1.0,0.0\n", Some(&silent)).is_ok());
    assert!(start.elapsed() < Duration::from_secs(20), "{:?}", start.elapsed());
}

#[test]
fn corrections_of_real_hesais() {
    let files = corpus("hesai").unwrap_or_default();
    for (name, angles) in files.iter().filter(|(name, _)| name.contains("Angle")) {
        let unit = name.split('_').next().unwrap();
        check_hesai(angles, &imported(angles));
        let of_unit = |name: &str| name.starts_with(unit) && name.contains("Firetime");
        let mut tried = 0;
        for (name, times) in files.iter().filter(|(name, _)| of_unit(name)) {
            println!("{name}");
            tried += 1;
            let sensor = sensor(&toml(angles, Some(times)).unwrap_or_else(|e| panic!("{e:#?}")));
            check_hesai(angles, &sensor);
            for column in 0..4 {
                let us = times_us(&sensor, column);
                assert!(us.iter().flatten().all(|us| (-60.0..140.0).contains(us)), "{us:?}");
                assert!(us.iter().any(Option::is_some));
            }
        }
        assert!(tried > 0, "{unit}");
    }
}

fn check_robosense(text: &str) {
    let angles: Vec<Vec<f64>> =
        text.lines().map(|line| line.split(',').map(|x| x.trim().parse().unwrap()).collect()).collect();
    let sensor = imported(text);
    for (row, beam) in rotating(&sensor).beams().iter().enumerate() {
        let below = angles.iter().filter(|other| other[0] < angles[beam.file_index][0]).count();
        assert_eq!(sensor.ring(row), below, "the driver counts rings from the lowest channel");
    }
    check_points(&sensor, |channel, azimuth, r| {
        // The formula is the driver's, with the rotor's azimuth clockwise, and 0 for a horizontal angle that is missing.
        let horizontal = angles[channel].get(1).copied().unwrap_or(0.0);
        let (vertical, a) = (angles[channel][0].to_radians(), -azimuth + horizontal.to_radians());
        let cos = libm::cos(vertical);
        DVec3::new(r * cos * libm::cos(a), -r * cos * libm::sin(a), r * libm::sin(vertical))
    });
}

#[test]
fn robosense_angles_give_the_points_of_the_driver() {
    check_robosense(&own("robosense.csv"));
    // The vertical angle alone (the case robosense_one_column), and with a ring.
    check_robosense("-15.3\n-13.2\n15.4\n13.2\n");
    check_robosense("-11.75,5.92,1\n-10.36,2.54,2\n-16.06,4.54,0\n");
    check_robosense(" 14.94,-4.07\t\n13.03\n10.92,-4.02\t\n");
    let many = "1.5,0.25\n".repeat(5000);
    assert_eq!(toml(&many, None).unwrap_err()[0].message, "the file has more than 4096 lines");
    for (_, text) in corpus("robosense").into_iter().flatten() {
        check_robosense(&text);
    }
}

/// An import writes no sensor file that reading would refuse: the numbers are the calibration's, so that is where it is told.
#[test]
fn what_would_be_refused_is_not_written() {
    let laser = |offset: &str| {
        format!(
            "lasers:\n- {{laser_id: 0, vert_correction: 0, rot_correction: 0, vert_offset_correction: {offset}}}\n"
        )
    };
    assert!(toml(&laser("0.2"), None).is_ok());
    let found = toml(&laser("1e300"), None).unwrap_err();
    assert!(
        found[0].message.starts_with("the sensor file of this calibration would be refused: "),
        "{found:?}"
    );
}
