"""Writes the universal files of this folder with pyuff 2.5.8 (MIT licence), and the numbers that they hold.

    python3 make_uff.py

The response is 4e6 / (s^2 + 40 s + 200^2) with 50 us delay, at s = i 2 pi f.
"""

import os

import numpy as np
import pyuff

here = os.path.dirname(os.path.abspath(__file__))


def response(hz):
    s = 2j * np.pi * hz
    return 4e6 / (s**2 + 40 * s + 200.0**2) * np.exp(-50e-6 * s)


def dataset(hz, binary, even, kind, function=4, title="sweep"):
    values = response(hz) if kind >= 5 else np.abs(response(hz))
    return pyuff.prepare_58(
        binary=binary, func_type=function, rsp_node=1, rsp_dir=3, ref_node=2, ref_dir=-3, data=values, x=hz, id1=title,
        rsp_ent_name="NONE", ref_ent_name="NONE", abscissa_spacing=int(even), abscissa_spec_data_type=18,
        ordinate_spec_data_type=8, orddenom_spec_data_type=13, ord_data_type=kind, num_pts=len(hz), abscissa_min=float(hz[0]),
        abscissa_inc=float(hz[1] - hz[0]) if even else 0.0, z_axis_value=0.0, abscissa_len_unit_exp=0,
        abscissa_force_unit_exp=0, abscissa_temp_unit_exp=0, abscissa_axis_units_lab="Hz", ordinate_len_unit_exp=0,
        ordinate_force_unit_exp=0, ordinate_temp_unit_exp=0, ordinate_axis_units_lab="m", orddenom_len_unit_exp=0,
        orddenom_force_unit_exp=0, orddenom_temp_unit_exp=0, orddenom_axis_units_lab="V", z_axis_axis_units_lab="NONE",
        z_axis_spec_data_type=0, z_axis_len_unit_exp=0, z_axis_force_unit_exp=0, z_axis_temp_unit_exp=0, id2="", id3="",
        id4="", id5="", ver_num=0, load_case_id=0, return_full_dict=True,
    )


def write(name, sets):
    path = os.path.join(here, name)
    if os.path.exists(path):
        os.remove(path)
    file = pyuff.UFF(path)
    for one in sets:
        file.write_sets(one, mode="add", force_double=one["ord_data_type"] != 5)


def as_single(name, mistaken):
    """pyuff 2.5.8 writes binary numbers of single type as doubles: keep that under `mistaken`, and write what it announces."""
    with open(os.path.join(here, name), "rb") as file:
        lines = file.read().split(b"\n", 13)
    if mistaken:
        with open(os.path.join(here, mistaken), "wb") as file:
            file.write(b"\n".join(lines))
    body, mark = lines[13][: lines[13].rindex(b"    -1")], b"    -1\n"
    single = np.frombuffer(body, "<f8").astype("<f4").tobytes()
    lines[1] = b"    58b%6i%6i%12i%12i%6i%6i%12i%12i" % (1, 2, 11, len(single), 0, 0, 0, 0)
    with open(os.path.join(here, name), "wb") as file:
        file.write(b"\n".join(lines[:13]) + b"\n" + single + mark)


even = np.arange(40) * 12.5 + 12.5
uneven = np.round(np.geomspace(10.0, 1000.0, 40), 3)
for kind, precision in ((5, "single"), (6, "double")):
    for binary, form in ((0, "text"), (1, "binary")):
        write(f"even_{precision}_{form}.uff", [dataset(even, binary, True, kind)])
        write(f"uneven_{precision}_{form}.uff", [dataset(uneven, binary, False, kind)])
as_single("even_single_binary.uff", "doubles_called_single.uff")
as_single("uneven_single_binary.uff", None)
write("two_responses.uff", [dataset(even, 0, True, 6, title="first"), dataset(uneven, 0, False, 6, title="second")])
write("from_zero.uff", [dataset(np.arange(20) * 25.0, 0, True, 6)])
write("coherence_only.uff", [dataset(even, 0, True, 4, function=6)])
for name in ("even_double_text", "uneven_double_binary"):
    back = pyuff.UFF(os.path.join(here, name + ".uff")).read_sets()
    print(name, np.abs(np.asarray(back["data"]) / response(np.asarray(back["x"])) - 1).max())
