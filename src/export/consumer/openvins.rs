//! OpenVINS, `kalibr_imu_chain.yaml`. Source: rpng/open_vins, config/euroc_mav, ov_msckf/src/state/Propagator.cpp: Q_d = N²/dt and K² dt.

use super::kalibr::four;
use super::{Export, Written};

const IDENTITY: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

pub(super) fn write(export: &Export) -> Result<Written, String> {
    // the reader wants its directive first
    let mut text = String::from("%YAML:1.0\n");
    text.push_str(&export.walk_head(
        "#",
        &[
            "OpenVINS kalibr_imu_chain.yaml: continuous densities; Q_d = N^2/dt, K^2 dt",
            "geometry is not known here: identities stand for it",
        ],
    ));
    let mut warnings =
        vec!["T_i_b, Tw, R_IMUtoGYRO, Ta, R_IMUtoACC, Tg are identities and zeros: put your own there".to_owned()];
    text.push_str("imu0:\n  T_i_b:\n");
    for i in 0..4 {
        let row: Vec<&str> = (0..4).map(|j| if i == j { "1.0" } else { "0.0" }).collect();
        text.push_str(&format!("    - [{}]\n", row.join(", ")));
    }
    four(export, "  ", &mut text, &mut warnings)?;
    text.push_str(&format!(
        "  rostopic: /imu0\n  time_offset: 0.0\n  update_rate: {:.3}\n  model: \"kalibr\"\n",
        export.rate()
    ));
    for name in ["Tw", "R_IMUtoGYRO", "Ta", "R_IMUtoACC", "Tg"] {
        text.push_str(&format!("  {name}:\n"));
        for row in IDENTITY {
            let of = |v: f64| format!("{:.1}", if name == "Tg" { 0.0 } else { v });
            text.push_str(&format!("    - [{}]\n", row.map(of).join(", ")));
        }
    }
    Ok(Written { text, warnings })
}
