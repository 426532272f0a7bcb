use super::*;

/// Name, unit and sensor of a header cell.
fn told(cell: &str) -> (String, String, Option<Quantity>) {
    let head = Head::parse(cell);
    let unit = head.unit.as_ref().map_or(String::new(), |u| u.times_time(0).text().to_string());
    let sensor = sensor_of(&words(&head.name));
    (head.name, unit, sensor)
}

#[test]
fn cells_of_real_headers() {
    const GYRO: Option<Quantity> = Some(Quantity::AngularRate);
    const FORCE: Option<Quantity> = Some(Quantity::SpecificForce);
    let table = [
        ("gyro_x (deg/s)", "gyro_x", "deg/s", GYRO),
        ("w_RS_S_x [rad s^-1]", "w_RS_S_x", "rad/s", GYRO),
        ("a_RS_S_x [m s^-2]", "a_RS_S_x", "m/s^2", FORCE),
        ("Gyroscope X (deg/s)", "Gyroscope X", "deg/s", GYRO),
        ("Accelerometer Z (g)", "Accelerometer Z", "g", FORCE),
        ("UncompGyroX (rad/s)", "UncompGyroX", "rad/s", GYRO),
        ("IMU::UncompGyro::X [rad/s]", "IMU::UncompGyro::X", "rad/s", GYRO),
        ("IMU::AngularRate::X", "IMU::AngularRate::X", "", GYRO),
        ("gyr_x_dps", "gyr_x", "deg/s", GYRO),
        ("gyr_y_rad_s", "gyr_y", "rad/s", GYRO),
        ("gyro_z_deg_per_s", "gyro_z", "deg/s", GYRO),
        ("acc_x_g", "acc_x", "g", FORCE),
        ("acc_x_m_s2", "acc_x", "m/s^2", FORCE),
        ("accel_y_mg", "accel_y", "mg", FORCE),
        ("Gyr_X", "Gyr_X", "", GYRO),
        ("GyrX", "GyrX", "", GYRO),
        ("xgyro", "xgyro", "", GYRO),
        ("gx", "gx", "", GYRO),
        ("wz", "wz", "", GYRO),
        ("ax", "ax", "", FORCE),
        ("angular_velocity.x", "angular_velocity.x", "", GYRO),
        ("field.linear_acceleration.z", "field.linear_acceleration.z", "", FORCE),
        ("gyro_rad[0]", "gyro_rad[0]", "", GYRO),
        ("%float(RawGyroX)", "RawGyroX", "", GYRO),
        ("\u{3c9}_x [\u{b0}/s]", "\u{3c9}_x", "deg/s", None),
        ("gyro x / (mdeg/s)", "gyro x", "mdeg/s", GYRO),
        // no sensor output, though the words are near
        ("truth_gyro_x (deg/s)", "truth_gyro_x", "deg/s", None),
        ("gyro_bias_x (deg/s)", "gyro_bias_x", "deg/s", None),
        ("Mag_X", "Mag_X", "", None),
        ("temp_c", "temp", "degC", None),
        ("Temp_degC", "Temp", "degC", None),
        ("gyro_temp_k", "gyro_temp", "K", None),
        ("imuTempF", "imuTemp", "degF", None),
        ("temperature (\u{b0}C)", "temperature", "degC", None),
        ("temperature (C)", "temperature", "degC", None),
        ("Temp [deg F]", "Temp", "degF", None),
        ("IMU::Temp [Celsius]", "IMU::Temp", "degC", None),
        ("T (K)", "T", "K", None),
        ("temp (1/340 degC)", "temp", "degC", None),
        ("temp", "temp", "", None),
        ("acc_tempc", "acc_tempc", "", None),
        ("n_samples", "n_samples", "", None),
        ("Barometer (hPa)", "Barometer", "", None),
        ("", "", "", None),
    ];
    for (cell, name, unit, sensor) in table {
        assert_eq!(told(cell), (name.to_string(), unit.to_string(), sensor), "{cell}");
    }
}

#[test]
fn times_and_their_units() {
    let table = [
        ("t_s", "s", 2),
        ("time_s", "s", 2),
        ("Time (s)", "s", 2),
        ("Timestamp (us)", "us", 2),
        ("timestamp [ns]", "ns", 2),
        ("TimeUS", "us", 2),
        ("timestamp_ms", "ms", 2),
        ("seconds", "s", 2),
        ("millis", "ms", 2),
        ("t", "", 2),
        ("time", "", 2),
        ("%int(ChipTimeUS)", "us", 1),
        ("SampleTimeFine", "", 1),
        ("Time::TimeStartup [ns]", "ns", 1),
        ("IMU::DeltaTime [s]", "s", 0),
        ("Time::GpsWeek", "", 0),
        ("Time::TimeStatus::timeOk", "", 0),
        ("t_start_s", "", 0),
        ("temp_s", "", 0),
        ("gyr_x_s", "", 0),
        ("Counter", "", 0),
    ];
    for (cell, unit, rank) in table {
        let head = Head::parse(cell);
        let found = head.unit.as_ref().map_or("", |u| u.text());
        assert_eq!((found, time_rank(&head.name)), (unit, rank), "{cell}");
    }
}

#[test]
fn a_unit_that_is_none_stays_as_text() {
    let head = Head::parse("gyro_x (furlongs)");
    assert_eq!(
        (head.name.as_str(), head.unit_text.as_deref(), head.unit.is_none()),
        ("gyro_x", Some("furlongs"), true)
    );
    let mut head = Head::parse("gyro_x");
    head.set_unit_below("[deg/s]");
    assert_eq!(head.unit.map(|u| u.text().to_string()).as_deref(), Some("deg/s"));
}
