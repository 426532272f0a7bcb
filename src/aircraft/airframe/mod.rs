//! STUB
use crate::aircraft::atmosphere::standard;
#[derive(Clone, Copy, Debug)]
pub struct AirState { pub velocity: [f64; 3], pub rate: [f64; 3] }
#[derive(Clone, Copy, Debug)]
pub struct Controls { pub elevator: f64, pub aileron: f64, pub rudder: f64, pub throttle: f64 }
#[derive(Clone, Copy, Debug)]
pub struct Wrench { pub force: [f64; 3], pub moment: [f64; 3] }
#[derive(Clone, Copy, Debug)]
pub struct Inertia { pub xx: f64, pub yy: f64, pub zz: f64, pub xz: f64 }
#[derive(Clone, Copy, Debug)]
pub struct ReferenceSize { pub area: f64, pub span: f64, pub chord: f64 }
#[derive(Clone, Debug)]
pub struct Airplane { pub name: String, pub mass: f64, pub inertia: Inertia, pub reference: ReferenceSize }
impl Airplane {
    pub fn aerosonde() -> Airplane {
        let _ = standard::GRAVITY;
        Airplane { name: "Aerosonde".into(), mass: 11.0, inertia: Inertia { xx: 0.8244, yy: 1.135, zz: 1.759, xz: 0.1204 }, reference: ReferenceSize { area: 0.55, span: 2.8956, chord: 0.18994 } }
    }
    pub fn forces(&self, air: &AirState, k: &Controls, rho: f64) -> Wrench {
        let [u, v, w] = air.velocity; let [p, q, r] = air.rate;
        let speed = (u*u+v*v+w*w).sqrt(); let al = w.atan2(u); let be = (v/speed).asin();
        let (s, b, c) = (0.55, 2.8956, 0.18994);
        let (ph, qh, rh) = (b*p/2.0/speed, c*q/2.0/speed, b*r/2.0/speed);
        let qs = 0.5*rho*speed*speed*s;
        let (m, a0) = (50.0, 0.47);
        let e1 = (-m*(al-a0) as f64).exp(); let e2 = (m*(al+a0) as f64).exp();
        let sg = (1.0+e1+e2)/((1.0+e1)*(1.0+e2));
        let lin = 0.23+5.61*al;
        let cl = (1.0-sg)*lin + sg*2.0*al.signum()*al.sin().powi(2)*al.cos() + 7.95*qh + 0.13*k.elevator;
        let cd = 0.043 + lin*lin/(std::f64::consts::PI*0.9*b*b/s);
        let cy = -0.98*be + 0.075*k.aileron + 0.19*k.rudder;
        let cll = -0.13*be -0.51*ph + 0.25*rh + 0.17*k.aileron + 0.0024*k.rudder;
        let cm = 0.0135 - 2.74*al - 38.21*qh - 0.99*k.elevator;
        let cn = 0.073*be - 0.069*ph - 0.095*rh - 0.011*k.aileron - 0.069*k.rudder;
        let tau = std::f64::consts::TAU; let d: f64 = 0.508; let kv = 60.0/(tau*145.0); let rr = 0.042; let vin = 44.4*k.throttle;
        let a = 0.005230*rho*d.powi(5)/(tau*tau);
        let bb = 0.004970*rho*d.powi(4)*speed/tau + kv*kv/rr;
        let cc = -0.01664*rho*d.powi(3)*speed*speed - kv*vin/rr + kv*1.5;
        let om = (-bb + (bb*bb-4.0*a*cc).sqrt())/(2.0*a);
        let n = om/tau; let j = speed/(n*d);
        let t = rho*n*n*d.powi(4)*(0.09357-0.06044*j-0.1079*j*j);
        let tq = rho*n*n*d.powi(5)*(0.005230+0.004970*j-0.01664*j*j);
        Wrench { force: [qs*(cl*al.sin()-cd*al.cos())+t, qs*cy, qs*(-cl*al.cos()-cd*al.sin())], moment: [qs*b*cll - tq, qs*c*cm, qs*b*cn] }
    }
}
