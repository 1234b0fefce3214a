//! Variants of LiDARs' files that exist in the field.

use beamcast::config::load_sensor;
use beamcast::import::{Format, Source, import};
use beamcast::sensor::{Capture, Pattern, Sensor, azimuth_elevation};

use super::{imported, own, rotating, sensor, toml};

/// The case ouster_command_not_recognized: what the SDK's client stores of firmware 1.12 and 1.13.
#[test]
fn metadata_of_old_firmware_has_an_error_in_place_of_a_table() {
    let transform = "[-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 36.18, 0, 0, 0, 1]";
    let metadata = |format: &str| {
        format!(
            "{{\"beam_intrinsics\": {{\"beam_altitude_angles\": [9.0, 3.0, -3.0, -9.0], \"beam_azimuth_angles\": [3.0, 1.0, \
             -1.0, -3.0]}}, \"calibration_status\": \"error: Command not recognized.\", \"config_params\": \
             {{\"lidar_mode\": \"1024x10\"}}, \"lidar_data_format\": {format}, \"lidar_intrinsics\": \
             {{\"lidar_to_sensor_transform\": {transform}}}, \"sensor_info\": {{\"prod_line\": \"OS-1-64\"}}}}"
        )
    };
    let sensor = imported(&metadata("\"error: Command not recognized.\""));
    assert_eq!((sensor.pattern.rows(), sensor.pattern.columns()), (4, 1024));
    // Another text is no answer of a sensor.
    let found = toml(&metadata("\"1024x10\""), None).unwrap_err();
    assert_eq!(found[0].message, "`lidar_data_format` is the string \"1024x10\"");
}

/// The unit's own shifts survive, whatever the azimuths would give, and a destaggered image is that of the SDK's `destagger`:
/// pixel c of row i is firing c − shift.
#[test]
fn a_units_own_pixel_shifts_are_kept() {
    let metadata: serde_json::Value = serde_json::from_str(&own("ouster_nested.json")).unwrap();
    let beams = metadata["beam_intrinsics"]["beam_altitude_angles"].as_array().unwrap().len();
    let columns = metadata["lidar_data_format"]["columns_per_frame"].as_u64().unwrap() as i64;
    let shifts: Vec<i64> = (0..beams as i64).map(|row| 5 - 3 * row).collect();
    let with = |shifts: &[i64]| {
        let mut changed = metadata.clone();
        changed["lidar_data_format"]["pixel_shift_by_row"] = shifts.into();
        changed["lidar_data_format"]["column_window"] = vec![0, columns - 1].into();
        changed.to_string()
    };
    let text = toml(&with(&shifts), None).unwrap();
    let staggered = sensor(&text);
    assert!(!rotating(&staggered).is_destaggered());
    let image = sensor(&text.replace("layout = \"staggered\"", "layout = \"destaggered\""));
    assert!(rotating(&image).is_destaggered());
    for (row, beam) in rotating(&image).beams().iter().enumerate() {
        let shift = shifts[beam.file_index];
        for column in [0, 1, columns / 2, columns - 1] {
            let firing = (column - shift).rem_euclid(columns) as usize;
            assert_eq!(rotating(&image).firing(row, column as usize), firing, "row {row}, column {column}");
        }
    }
    let message = |shifts: &[i64]| toml(&with(shifts), None).unwrap_err()[0].message.clone();
    assert_eq!(
        message(&shifts[1..]),
        format!(
            "`lidar_data_format.pixel_shift_by_row` has {} numbers, and there are {beams} beams",
            beams - 1
        )
    );
    let mut far = shifts.clone();
    far[0] = columns;
    assert_eq!(message(&far), format!("`lidar_data_format.pixel_shift_by_row` has {columns}"));
}

/// A sensor file that names a table of this text, with more keys for `[rays]`.
fn of_table(table: &str, more: &str) -> (Sensor, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("table.csv"), table).unwrap();
    assert_eq!(Format::of(table), Some(Format::Rays));
    let toml = import(Format::Rays, Source { name: "table.csv", text: table }, None).unwrap();
    let path = folder.path().join("sensor.toml");
    std::fs::write(&path, toml + more).unwrap();
    let file = load_sensor(&path).unwrap_or_else(|e| panic!("{e}"));
    (file.sensor, file.warnings.iter().map(|w| w.message.clone()).collect())
}

fn angles(sensor: &Sensor, frame: u64, row: usize, column: usize) -> [f64; 2] {
    let pulse = Capture::at_origin(sensor).with_frame(frame).pulse(row, column).unwrap();
    let (azimuth, elevation) = azimuth_elevation(pulse.direction);
    [azimuth, elevation].map(|angle| (angle.degrees() * 1e6).round() / 1e6)
}

/// The case livox_csv: zenith counts from straight up, and `Time/s` counts the rays.
#[test]
fn livoxs_pattern_tables_are_read() {
    let table = "Time/s,Azimuth/deg,Zenith/deg\n1,0,90\n2,90,45\n3,170,120\n4,270,80\n";
    let (sensor, warnings) = of_table(table, "");
    let found: Vec<_> = (0..4).map(|column| angles(&sensor, 0, 0, column)).collect();
    assert_eq!(found, [[0.0, 0.0], [90.0, 45.0], [170.0, -30.0], [-90.0, 10.0]]);
    assert_eq!(warnings, ["this column counts the rays, and is no time"]);
    assert_eq!(sensor.pattern.last_pulse_s(), 0.0);
    // Two lines, which fire twenty times a second, in frames of a tenth of a second.
    let (sensor, warnings) = of_table(table, "lines = 2\npulse_rate_hz = 20.0\nrate_hz = 20.0\n");
    assert_eq!((sensor.pattern.rows(), sensor.pattern.columns(), warnings.len()), (2, 1, 0));
    assert_eq!([angles(&sensor, 0, 1, 0), angles(&sensor, 1, 0, 0)], [[90.0, 45.0], [170.0, -30.0]]);
    assert_eq!(angles(&sensor, 2, 0, 0), [0.0, 0.0]);
    // Seconds stay seconds, and files of forks write headers in other letters.
    let (sensor, warnings) = of_table("time/s,azimuth/deg,zenith/deg\r\n0.5,1,89\r\n0.50001,2,88\r\n", "");
    assert_eq!((sensor.pattern.last_pulse_s(), warnings.len()), (0.50001, 0));
    let (sensor, _) = of_table("azimuth_deg,zenith_deg\n10,100\n", "");
    assert_eq!(angles(&sensor, 0, 0, 0), [10.0, -10.0]);
    assert!(matches!(sensor.pattern, Pattern::Rays(_)));
}
