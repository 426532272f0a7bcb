"""Flights of `kfdesign fly` beside JSBSim: the same airplane, differences that vanish with JSBSim's step, and what a
flight costs.

python benches/flight_peers.py [KFDESIGN] [FLIGHTS], with jsbsim 1.3.3 and numpy in a scratch environment; KFDESIGN is
the program (default: kfdesign on the path), FLIGHTS how many are flown for the cost (default 100). The aircraft file is
written here from data/airplanes/aerosonde.json.

What one must know of JSBSim to compare with it:
- Its `ixz` is the negated product of inertia unless mass_balance says negated_crossproduct_inertia="false": with the
  wrong sign 0.6 m after 10 s.
- It takes kg m^2 for slug ft^2 by 1.35594 in place of 1.35581795: inertia in KG*M2 comes out 9e-5 too small, so it is
  given in SLUG*FT2.
- Forces must stand in body axes (X, Y, Z). LIFT, DRAG and SIDE are rotated by sideslip too and belong to another model.
- Its gas constant and its pressure at sea level (2116.228 psf) differ: its density is 8.1e-6 above that of ISO 2533.
  Here density is made of its temperature and of its pressure, scaled to 101325 Pa.
- A flat earth is a planet that does not rotate, large, but not so large that the altitude loses digits: at 6.4e9 m
  200 m of way bend by 3e-6 m and 3e-8 rad, and rounding leaves 2e-4 m; at 6.4e10 m it leaves 5e-3 m.
- Lengths given in metres go through a factor of eight digits: its start lies 0.6 mm (9.7 m of 6.4e9 m) beside ours.
  Positions are compared as ways.
- Its forces are held over a step, so that it converges to first order: differences halve with its step, and
  extrapolate to what both agree to.
- Initial p, q, r are relative to the earth, as in flight.json.
"""

import ast
import json
import math
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor

import jsbsim
import numpy as np

ROOT = pathlib.Path(__file__).resolve().parent.parent
FT, LBF, LBFT = 0.3048, 4.4482216152605, 1.3558179483314004
SLUGFT2 = 1.3558179483314004
FLAT_RADIUS = 6.4e9
G = 9.80665
R_GAS = 287.05287
# of ours and theirs, one after the other: the machine is never quite at rest
ROUNDS = 5


def number(text):
    return float(str(text).split()[0])


def expression(text, names):
    """A Python expression as JSBSim's function elements; names are properties."""

    def element(node):
        if isinstance(node, ast.Constant):
            return f"<value>{node.value!r}</value>"
        if isinstance(node, ast.Name):
            return f"<property>{names[node.id]}</property>"
        if isinstance(node, ast.UnaryOp):
            return f"<product><value>-1</value>{element(node.operand)}</product>"
        if isinstance(node, ast.BinOp):
            tag = {ast.Add: "sum", ast.Sub: "difference", ast.Mult: "product", ast.Div: "quotient", ast.Pow: "pow"}[type(node.op)]
            return f"<{tag}>{element(node.left)}{element(node.right)}</{tag}>"
        if isinstance(node, ast.Call):
            return f"<{node.func.id}>{''.join(map(element, node.args))}</{node.func.id}>"
        raise ValueError(ast.dump(node))

    return element(ast.parse(text, mode="eval").body)


def aircraft(folder, loaded):
    """Writes aircraft/peer/peer.xml of the shipped airplane. `loaded`: with servos and sensors, for the cost."""
    a = json.loads((ROOT / "data/airplanes/aerosonde.json").read_text())
    aero, prop, ref, inertia = a["aerodynamics"], a["propulsion"], a["reference"], a["inertia"]
    S, b, c = (number(ref[k]) for k in ("area", "span", "chord"))
    names = {
        "uf": "velocities/u-aero-fps", "vf": "velocities/v-aero-fps", "wf": "velocities/w-aero-fps",
        "P": "velocities/p-aero-rad_sec", "Q": "velocities/q-aero-rad_sec", "R": "velocities/r-aero-rad_sec",
        "pressure": "atmosphere/P-psf", "temperature": "atmosphere/T-R",
        "de": "ext/de", "da": "ext/da", "dr": "ext/dr", "dt": "ext/dt",
    }
    if loaded:
        names |= {"de": "ext/de-pos", "da": "ext/da-pos", "dr": "ext/dr-pos"}
    functions = []

    def define(name, text):
        functions.append(f'<function name="f/{name}">{expression(text, names)}</function>')
        names[name] = f"f/{name}"

    lift, pitch, drag, stall = aero["lift"], aero["pitch"], aero["drag"], aero["stall"]
    psf, rankine = 101325 / 2116.228, 5 / 9
    define("V", f"{FT}*(uf*uf+vf*vf+wf*wf)**0.5")
    define("rho", f"pressure*{psf}/({R_GAS}*{rankine}*temperature)")
    define("alpha", "atan2(wf,uf)")
    define("beta", f"asin(vf*{FT}/V)")
    define("ph", f"P*{b}/(2*V)")
    define("qh", f"Q*{c}/(2*V)")
    define("rh", f"R*{b}/(2*V)")
    define("qS", f"0.5*rho*V*V*{S}")
    define("lin", f"{number(lift['zero'])}+{number(lift['alpha'])}*alpha")
    M, A0 = number(stall["sharpness"]), number(stall["angle"])
    define("e1", f"exp(-{M}*(alpha-{A0}))")
    define("e2", f"exp({M}*(alpha+{A0}))")
    define("blend", "(1+e1+e2)/((1+e1)*(1+e2))")
    # sign(alpha) sin^2 alpha = |sin alpha| sin alpha
    define("CL", f"(1-blend)*lin+blend*2*abs(sin(alpha))*sin(alpha)*cos(alpha)+{number(lift['pitch_rate'])}*qh+{number(lift['elevator'])}*de")
    define("CD", f"{number(drag['parasitic'])}+lin*lin/{math.pi * number(drag['oswald']) * b * b / S}")
    define("Cm", f"{number(pitch['zero'])}+{number(pitch['alpha'])}*alpha+{number(pitch['pitch_rate'])}*qh+{number(pitch['elevator'])}*de")
    for name, key in (("CY", "side"), ("Cl", "roll"), ("Cn", "yaw")):
        d = {k: number(v) for k, v in aero[key].items()}
        define(name, f"{d['beta']}*beta+{d['p']}*ph+{d['r']}*rh+{d['aileron']}*da+{d['rudder']}*dr")
    D, kv = number(prop["diameter"]), 60 / (2 * math.pi * number(prop["speed_constant"]))
    res, i0, vmax = number(prop["resistance"]), number(prop["no_load_current"]), number(prop["voltage"])
    t0, t1, t2 = map(number, prop["thrust"])
    q0, q1, q2 = map(number, prop["torque"])
    define("qa", f"{q0 * D**5 / (2 * math.pi) ** 2}*rho")
    define("qb", f"{q1 * D**4 / (2 * math.pi)}*rho*V+{kv * kv / res}")
    define("qc", f"{q2 * D**3}*rho*V*V-{kv * vmax / res}*dt+{kv * i0}")
    define("n", f"(-qb+(qb*qb-4*qa*qc)**0.5)/(2*qa)/{2 * math.pi}")
    define("J", f"V/(n*{D})")
    define("T", f"{D**4}*rho*n*n*({t0}+{t1}*J+{t2}*J*J)")
    define("torque", f"{D**5}*rho*n*n*({q0}+{q1}*J+{q2}*J*J)")
    axes = {
        "X": (f"(qS*(CL*sin(alpha)-CD*cos(alpha))+T)/{LBF}"), "Y": f"qS*CY/{LBF}",
        "Z": f"-qS*(CL*cos(alpha)+CD*sin(alpha))/{LBF}", "ROLL": f"(qS*{b}*Cl-torque)/{LBFT}",
        "PITCH": f"qS*{c}*Cm/{LBFT}", "YAW": f"qS*{b}*Cn/{LBFT}",
    }
    axes = "".join(f'<axis name="{k}"><function name="f/axis-{k}">{expression(v, names)}</function></axis>' for k, v in axes.items())
    channels = ""
    if loaded:
        for surface in ("de", "da", "dr"):
            channels += (
                f'<channel name="{surface}"><actuator name="{surface}"><input>ext/{surface}-command</input><lag>35</lag>'
                "<rate_limit>5.236</rate_limit><clipto><min>-0.436</min><max>0.436</max></clipto>"
                f"<output>ext/{surface}-pos</output></actuator></channel>"
            )
        # sensors and autopilot at 100 Hz, every fourth step, as ours
        channels += '<channel name="slow" execrate="4">'
        rates = [f"velocities/{k}-rad_sec" for k in "pqr"]
        for k, measured in enumerate(rates + [f"accelerations/N{k}" for k in "xyz"]):
            channels += (
                f'<sensor name="s{k}"><input>{measured}</input>'
                '<noise variation="ABSOLUTE" distribution="GAUSSIAN">0.01</noise>'
                f"<drift_rate>0.0001</drift_rate><bias>0.01</bias><output>ext/sensor{k}</output></sensor>"
            )
        channels += (
            '<washout_filter name="turning"><input>ext/sensor2</input><c1>1.0</c1>'
            "<output>ext/turning</output></washout_filter>"
        )
        inputs = {name: f"ext/{name}" for name in ("de", "da", "dr", "turning")}
        inputs |= {"p": "ext/sensor0", "q": "ext/sensor1", "phi": "attitude/phi-rad", "theta": "attitude/theta-rad"}
        laws = {
            "de": "de+0.2*q+0.6*(theta-0.053874)", "da": "da-0.06*p-0.6*(phi+0.00053)", "dr": "dr+0.15*turning",
        }
        for surface, law in laws.items():
            channels += (
                f'<fcs_function name="law-{surface}"><function name="law/{surface}">'
                f"{expression(law, inputs)}</function>"
                f"<output>ext/{surface}-command</output></fcs_function>"
            )
        channels += "</channel>"
    properties = ["de", "da", "dr", "dt", "turning", *(f"sensor{k}" for k in range(6))]
    properties += [f"{surface}-{what}" for surface in ("de", "da", "dr") for what in ("pos", "command")]
    declared = "".join(f'<property value="0">ext/{k}</property>' for k in properties)
    moment = {k: repr(number(v) / SLUGFT2) for k, v in inertia.items()}
    text = f"""<?xml version="1.0"?>
<fdm_config name="peer" version="2.0" release="ALPHA">
<fileheader><author>kfdesign</author><description>aerosonde.json</description></fileheader>
<metrics><wingarea unit="M2">{S}</wingarea><wingspan unit="M">{b}</wingspan><chord unit="M">{c}</chord>
<location name="AERORP" unit="M"><x>0</x><y>0</y><z>0</z></location><location name="EYEPOINT" unit="M"><x>0</x><y>0</y><z>0</z></location>
<location name="VRP" unit="M"><x>0</x><y>0</y><z>0</z></location></metrics>
<mass_balance negated_crossproduct_inertia="false"><ixx unit="SLUG*FT2">{moment['xx']}</ixx><iyy unit="SLUG*FT2">{moment['yy']}</iyy>
<izz unit="SLUG*FT2">{moment['zz']}</izz><ixz unit="SLUG*FT2">{moment['xz']}</ixz><emptywt unit="KG">{number(a['mass'])}</emptywt>
<location name="CG" unit="M"><x>0</x><y>0</y><z>0</z></location></mass_balance>
<ground_reactions/><propulsion/><flight_control name="peer">{declared}{channels}</flight_control>
<aerodynamics>{''.join(functions)}{axes}</aerodynamics></fdm_config>"""
    target = folder / "aircraft" / "peer"
    target.mkdir(parents=True, exist_ok=True)
    (target / "peer.xml").write_text(text)
    (folder / "flat.xml").write_text(
        f'<?xml version="1.0"?><planet name="flat"><semimajor_axis unit="M">{FLAT_RADIUS}</semimajor_axis>'
        f'<semiminor_axis unit="M">{FLAT_RADIUS}</semiminor_axis><rotation_rate unit="RAD/SEC">0</rotation_rate>'
        f'<GM unit="M3/SEC2">{G * FLAT_RADIUS**2!r}</GM><J2>0</J2></planet>'
    )


def started(folder, step, start, controls, wind=(0, 0), flat=False, place=(0.0, 0.0)):
    jsbsim.FGJSBBase().debug_lvl = 0
    fdm = jsbsim.FGFDMExec(str(folder))
    fdm.set_debug_level(0)
    if flat:
        assert fdm.load_planet(str(folder / "flat.xml"), False)
    assert fdm.load_model("peer")
    fdm.set_dt(step)
    if flat:
        fdm["simulation/gravity-model"] = 0
    fdm["ic/lat-geod-deg"], fdm["ic/long-gc-deg"] = place
    fdm["ic/h-sl-ft"] = start["height"] / FT
    fdm["ic/psi-true-deg"] = math.degrees(start["psi"])
    fdm["ic/theta-deg"], fdm["ic/phi-deg"] = math.degrees(start["theta"]), math.degrees(start["phi"])
    for k in "uvw":
        fdm[f"ic/{k}-fps"] = start[k] / FT
    for k in "pqr":
        fdm[f"ic/{k}-rad_sec"] = start[k]
    for k, v in zip(("de", "da", "dr", "dt"), controls):
        fdm[f"ext/{k}"] = v
    assert fdm.run_ic()
    # run_ic sets the wind to that of its own conditions, which is none
    fdm["atmosphere/wind-north-fps"], fdm["atmosphere/wind-east-fps"] = wind[0] / FT, wind[1] / FT
    return fdm


def state(fdm, flat):
    velocity = [fdm[f"velocities/{k}-fps"] * FT for k in "uvw"]
    attitude = [fdm[f"attitude/{k}-rad"] for k in ("phi", "theta", "psi")]
    rates = [fdm[f"velocities/{k}-rad_sec"] for k in "pqr"]
    ecef = np.array([fdm[f"position/ecef-{k}-ft"] * FT for k in "xyz"])
    place = np.array([ecef[2], ecef[1], FLAT_RADIUS - ecef[0]]) if flat else ecef
    return {"velocity": velocity, "attitude": attitude, "rates": rates, "position": place}


def ours(program, folder, document, every="10s", duration="10s"):
    (folder / "flight.json").write_text(json.dumps(document))
    subprocess.run([program, "fly", str(folder / "flight.json"), "-o", str(folder / "out.npy"), "--duration", duration, "--every", every], check=True, stdout=subprocess.DEVNULL)
    return np.load(folder / "out.npy")


def our_state(row, flat):
    get = lambda *names: [float(row[[n for n in row.dtype.names if n.split(" ")[0] == name][0]]) for name in names]
    if flat:
        place = np.array(get("north", "east", "down"))
    else:
        lat, lon, h = get("latitude", "longitude", "height")
        s, c = math.sin(math.radians(lat)), math.cos(math.radians(lat))
        a, f = 6378137.0, 1 / 298.257223563
        e2 = f * (2 - f)
        n = a / math.sqrt(1 - e2 * s * s)
        lon = math.radians(lon)
        place = np.array([(n + h) * c * math.cos(lon), (n + h) * c * math.sin(lon), (n * (1 - e2) + h) * s])
    return {"velocity": get("u", "v", "w"), "attitude": get("phi", "theta", "psi"), "rates": get("p", "q", "r"), "position": place}


def compare(program, folder):
    airplane = str(ROOT / "data/airplanes/aerosonde.json")
    thrown = {"altitude": "100 m", "u": "25 m/s", "v": "1 m/s", "w": "1.5 m/s", "phi": "10 deg", "theta": "5 deg", "psi": "30 deg", "p": "0.2 rad/s", "q": "-0.1 rad/s", "r": "0.1 rad/s"}
    fixed = {"elevator": "-0.14 rad", "aileron": "0.02 rad", "rudder": "-0.01 rad", "throttle": 0.8}
    turn = {"airspeed": "25 m/s", "altitude": "100 m", "bank": "30 deg"}
    place = {"wgs84": {"latitude": "48.7 deg", "longitude": "21.25 deg"}}
    wind = {"north": "5 m/s", "east": "-3 m/s"}
    cases = [
        ("thrown, flat", {"initial": thrown, "controls": fixed, "earth": "flat"}, (0.0, 0.0)),
        ("thrown, rotating", {"initial": thrown, "controls": fixed, "earth": place}, (48.7, 21.25)),
        ("turn in wind, flat", {"trim": turn, "wind": wind, "earth": "flat"}, (0.0, 0.0)),
        ("turn in wind, rotating", {"trim": turn, "wind": wind, "earth": place}, (48.7, 21.25)),
    ]
    print(f"{'':24}{'step':>8}{'position m':>13}{'velocity m/s':>14}{'attitude rad':>14}{'rates rad/s':>13}")
    for name, case, where in cases:
        flat = case["earth"] == "flat"
        table = ours(program, folder, {"format": "kfdesign-flight/1", "airplane": airplane, **case})
        first = table[0]
        get = lambda key: float(first[[n for n in first.dtype.names if n.split(" ")[0] == key][0]])
        start = {k: get(k) for k in ("u", "v", "w", "phi", "theta", "psi", "p", "q", "r")} | {"height": 100.0}
        controls = [get(k) for k in ("elevator", "aileron", "rudder", "throttle")]
        end = our_state(table[-1], flat)
        end["position"] -= our_state(first, flat)["position"]
        blow = (5.0, -3.0) if "wind" in case else (0, 0)
        rows = []
        for rate in (960, 1920, 3840):
            fdm = started(folder, 1 / rate, start, controls, blow, flat, where)
            begin = state(fdm, flat)
            for _ in range(10 * rate):
                fdm.run()
            theirs = state(fdm, flat)
            theirs["position"] -= begin["position"]
            rows.append({k: np.array(theirs[k]) - np.array(end[k]) for k in theirs})
            rows[-1]["attitude"][2] = (rows[-1]["attitude"][2] + math.pi) % (2 * math.pi) - math.pi
        # to step zero: twice the finer difference less the coarser
        rows.append({k: 2 * rows[2][k] - rows[1][k] for k in rows[0]})
        for label, row in zip(("1/960", "1/1920", "1/3840", "0"), rows):
            norm = {k: np.abs(v).max() for k, v in row.items()}
            print(f"{name:24}{label:>8}{norm['position']:13.1e}{norm['velocity']:14.1e}{norm['attitude']:14.1e}{norm['rates']:13.1e}")
            name = ""


def fly_peer(folder, seed, duration=60.0):
    start = {"u": 24.963728699, "v": 0, "w": 1.346198144, "phi": -0.00053056, "theta": 0.053873975, "psi": 0, "p": 0, "q": 0, "r": 0, "height": 100.0}
    fdm = started(folder, 1 / 400, start, (-0.135469407, 0.006129659, -0.000977192, 0.777789841))
    fdm["simulation/randomseed"] = seed
    fdm["atmosphere/turb-type"] = 3
    fdm["atmosphere/turbulence/milspec/windspeed_at_20ft_AGL-fps"] = 15 * 1.68781
    fdm["atmosphere/turbulence/milspec/severity"] = 3
    begin = time.process_time()
    for _ in range(int(duration * 400)):
        fdm.run()
    return time.process_time() - begin


def measured(command):
    """Processor time (s, user and system) and peak memory (MB) of a program on two threads."""
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL, env=os.environ | {"RAYON_NUM_THREADS": "2"})
    _, status, usage = os.wait4(child.pid, 0)
    assert status == 0, command
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1000


def cost(program, folder, flights):
    airplane = str(ROOT / "data/airplanes/aerosonde.json")
    document = {
        "format": "kfdesign-flight/1", "airplane": airplane, "trim": {"airspeed": "25 m/s", "altitude": "100 m"},
        "gusts": {"model": "dryden", "specification": "MIL-F-8785C", "wind_at_20ft": "15 kt"},
        "sensors": {"gyro": str(ROOT / "data/params.json"), "accelerometer": {
            "format": "kfdesign-params/1", "quantity": "specific-force", "sample_rate": "100 Hz", "axes": [{"name": "x", "white": {"density": "0.002 m/s^2/sqrt(Hz)"}}]}},
        "autopilot": {"rate": "100 Hz", "delay": 1, "gains": {"kq": "0.2 s", "ktheta": 0.6, "kp": "0.06 s", "kphi": 0.6, "kr": "0.15 s"}},
    }
    (folder / "flight.json").write_text(json.dumps(document))
    command = [program, "fly", str(folder / "flight.json"), "--duration", "60s", "--runs"]
    peers = max(2, flights // 25)
    ratios = []
    print(f"\n{flights} flights of 60 s at 400 Hz on two cores and {peers} of JSBSim, in turn:")
    print("processor time per flight second and core")
    with ProcessPoolExecutor(2) as pool:
        for _ in range(ROUNDS):
            ours = measured([*command, str(flights)])[0] / (flights * 60)
            theirs = sum(pool.map(fly_peer, [folder] * peers, range(peers))) / (peers * 60)
            ratios.append(theirs / ours)
            print(f"ours {1e3 * ours:.3f} ms, JSBSim {1e3 * theirs:.3f} ms: {ratios[-1]:.1f} times ours")
    print(f"least {min(ratios):.1f}, median {statistics.median(ratios):.1f} times ours")
    few, many = (measured([*command, str(runs)])[1] for runs in (10, 200))
    print(f"memory at its peak: {few:.1f} MB with 10 flights, {many:.1f} MB with 200")


def main():
    program = sys.argv[1] if len(sys.argv) > 1 else "kfdesign"
    flights = int(sys.argv[2]) if len(sys.argv) > 2 else 100
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(scratch)
        aircraft(folder, loaded=False)
        compare(program, folder)
        aircraft(folder, loaded=True)
        cost(program, folder, flights)


if __name__ == "__main__":
    main()
