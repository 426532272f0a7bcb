use kfdesign::input::*;
use kfdesign::units::*;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let mut o = LogOptions::default();
    let mut i = 2;
    while i < a.len() {
        let v = a[i + 1].clone();
        match a[i].as_str() {
            "--columns" => o.columns = Some(v.split(',').map(str::to_string).collect()),
            "--time" => o.time = Some(v),
            "--unit" => o.unit = Some(Unit::parse(&v).unwrap()),
            "--rate" => o.rate_hz = Some(v.parse().unwrap()),
            "--end" => o.end_s = Some(v.parse().unwrap()),
            "--start" => o.start_s = Some(v.parse().unwrap()),
            "--accel" => o.quantity = Some(Quantity::SpecificForce),
            _ => panic!(),
        }
        i += 2;
    }
    let t = std::time::Instant::now();
    match read(std::path::Path::new(&a[1]), &o) {
        Err(e) => println!("ERR {e}"),
        Ok((r, c)) => {
            println!(
                "{} n={} rate={} span={} base={:?} jitter={} missing={} start={} {:?} {:?}",
                r.name,
                c.samples,
                c.sample_rate_hz,
                c.span_s,
                c.time_base,
                c.jitter_s,
                c.missing,
                r.start_s,
                r.quantity,
                t.elapsed()
            );
            for x in &r.axes {
                let s: f64 = x.values.iter().filter(|v| !v.is_nan()).sum();
                println!(
                    "  {} [{}] first {:e} last {:e} mean {:e} nan {}",
                    x.name,
                    x.unit,
                    x.unit.from_si(x.values[0]),
                    x.unit.from_si(*x.values.last().unwrap()),
                    x.unit.from_si(s / x.values.iter().filter(|v| !v.is_nan()).count() as f64),
                    x.values.iter().filter(|v| v.is_nan()).count()
                );
            }
            for f in &c.findings {
                println!("   {} {}: {}", if f.serious { "!" } else { " " }, f.kind, f.message);
            }
        }
    }
}
