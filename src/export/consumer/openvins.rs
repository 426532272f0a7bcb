//! OpenVINS, `kalibr_imu_chain.yaml`. Source: rpng/open_vins, config/euroc_mav, ov_msckf/src/state/Propagator.cpp:
//! Q_d = N²/dt and K² dt.

use super::Export;
use super::kalibr::four;
use super::page::Page;

const IDENTITY: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

pub(super) fn write(export: &Export, page: &mut Page) -> Result<(), String> {
    // the reader wants its directive first
    page.first = "%YAML:1.0\n";
    page.about(&[
        "OpenVINS kalibr_imu_chain.yaml: continuous densities; Q_d = N^2/dt, K^2 dt",
        "geometry is not known here: identities stand for it",
    ]);
    page.warnings
        .push("T_i_b, Tw, R_IMUtoGYRO, Ta, R_IMUtoACC, Tg are identities and zeros: put your own there".to_owned());
    page.body.push_str("imu0:\n  T_i_b:\n");
    for i in 0..4 {
        let row: Vec<&str> = (0..4).map(|j| if i == j { "1.0" } else { "0.0" }).collect();
        page.body.push_str(&format!("    - [{}]\n", row.join(", ")));
    }
    four(export, "  ", page)?;
    page.body.push_str(&format!(
        "  rostopic: /imu0\n  time_offset: 0.0\n  update_rate: {:.3}\n  model: \"kalibr\"\n",
        export.rate()
    ));
    for name in ["Tw", "R_IMUtoGYRO", "Ta", "R_IMUtoACC", "Tg"] {
        page.body.push_str(&format!("  {name}:\n"));
        for row in IDENTITY {
            let of = |v: f64| format!("{:.1}", if name == "Tg" { 0.0 } else { v });
            page.body.push_str(&format!("    - [{}]\n", row.map(of).join(", ")));
        }
    }
    Ok(())
}
