"""Writes the MATLAB and Touchstone sweeps of this folder with scipy (1.17.1 made those that are here).

The response is 4e6 exp(-5e-5 s)/(s^2 + 60 s + 360^2) with a resonance pair, 120 points from 20 to 4000 Hz.
"""

import numpy
import scipy.io

hertz = numpy.geomspace(20.0, 4000.0, 120)
s = 2j * numpy.pi * hertz
pair = (s**2 + 2 * 0.03 * 7000 * s + 7000**2) / (s**2 + 2 * 0.02 * 7600 * s + 7600**2)
held = 4e6 * numpy.exp(-5e-5 * s) / (s**2 + 60 * s + 360**2) * pair

frd = {
    "ResponseData": held.reshape(1, 1, -1),
    "Frequency": 2 * numpy.pi * hertz.reshape(-1, 1),
    "FrequencyUnit": "rad/TimeUnit",
    "TimeUnit": "seconds",
    "Ts": 0.0,
    "Name": "axis 1",
}
two = numpy.stack([held, 2 * held]).reshape(2, 1, -1)
scipy.io.savemat("frd.mat", {"G": frd}, do_compression=True)
scipy.io.savemat("frd_plain.mat", {"G": frd})
scipy.io.savemat("two_outputs.mat", {"G": {**frd, "ResponseData": two, "Frequency": hertz, "FrequencyUnit": "Hz"}})
scipy.io.savemat("vectors.mat", {"f_hz": hertz, "H": held, "coherence": numpy.full(120, 0.98), "comment": "made up"})
phase = numpy.unwrap(numpy.angle(held))
scipy.io.savemat("bode.mat", {"w": 2 * numpy.pi * hertz, "mag": abs(held), "phase": numpy.degrees(phase)})
table = numpy.column_stack([hertz, 20 * numpy.log10(abs(held)), numpy.degrees(phase)])
scipy.io.savemat("table.mat", {"data": table.astype(numpy.float32)})
scipy.io.savemat("nothing.mat", {"a": numpy.eye(3), "names": numpy.array(["x", "y"], dtype=object)})

with open("axis.s1p", "w") as out:
    out.write("! made up\n# kHz S DB R 50\n")
    for f, v in zip(hertz, held):
        out.write(f"{f / 1e3:.9f} {20 * numpy.log10(abs(v)):.9f} {numpy.degrees(numpy.angle(v)):.9f}\n")
with open("axis.s2p", "w") as out:
    out.write("! S11 S21 S12 S22\n# Hz S RI R 50\n")
    for f, v in zip(hertz, held):
        out.write(f"{f:.9f} 0.1 0 {v.real:.12e} {v.imag:.12e} 0 0 0.2 0 ! a row\n")
    out.write("100 1.2 0.3 40 0.2\n200 1.3 0.3 41 0.2\n")
