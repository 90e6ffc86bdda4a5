#!/bin/sh
# Pictures of the main pages, made by the program itself and taken by headless Chromium: on a desk and on a phone, light and dark.
#   scripts/pictures.sh DIR    SERVOTUNE names the program by its whole path; else target/release/servotune, else target/debug/servotune
# Ends with 3, and says so, where there is no Chromium, no cwebp or no program. Takes some three minutes.
set -eu
cd "$(dirname "$0")/.."
root=$PWD
out=$1
program=${SERVOTUNE:-}
for found in target/release/servotune target/debug/servotune; do
    [ -z "$program" ] && [ -x "$found" ] && program=$PWD/$found
done
[ -n "$program" ] || { echo "no program: cargo build --release first, or name it by SERVOTUNE" >&2; exit 3; }
browser=
for name in chromium chromium-browser google-chrome; do
    [ -z "$browser" ] && command -v "$name" >/dev/null && browser=$name
done
[ -n "$browser" ] || { echo "no pictures: chromium is not installed" >&2; exit 3; }
command -v cwebp >/dev/null || { echo "no pictures: cwebp is not installed (apt-get install webp)" >&2; exit 3; }
mkdir -p "$out"
out=$(cd "$out" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# The pages: one machine from its sweep to the certificate, a write, a line of machines, a floor, a diagnosis, the worked machines.
cd "$work"
"$program" -q init spiral . >/dev/null
"$program" -q identify sweep.csv --out plant.toml --report identify.html >/dev/null
"$program" -q tune --plant plant.toml --spec spec.toml --controller controller.toml --out gains.toml --report tune.html >/dev/null || [ $? = 1 ]
"$program" -q verify gains.toml --plant plant.toml --spec spec.toml --report verify.html >/dev/null || [ $? = 1 ]
"$program" -q simulate --plant plant.toml --controller gains.toml --profile profile.toml --spec spec.toml --report simulate.html >/dev/null
"$program" -q budget --plant plant.toml --controller controller.toml --profile profile.toml --predict gains.toml --report budget.html >/dev/null
"$program" -q margins --plant plant.toml --controller controller.toml --controller gains.toml --report margins.html >/dev/null
"$program" -q twin line --out line --count 120 >/dev/null
"$program" -q features line --out features.csv >/dev/null
"$program" -q train features.csv --label label --hidden 32 --epochs 40 --out gate.json --report train.html >/dev/null
"$program" -q classify features.csv --gate gate.json --report classify.html >/dev/null || [ $? = 1 ]

"$program" -q pareto --plant plant.toml --spec spec.toml --controller controller.toml --out pareto.html >/dev/null
"$program" -q twin fleet --out floor --testers 1 >/dev/null
"$program" -q fleet run floor/FLEET.toml --out run >/dev/null 2>&1 || [ $? = 1 ]
cp run/fleet.html fleet.html
# Of the slots the first that has gains of its own; the fleet's page lists it as `tuned`.
cp "run/slots/$(sed -n 's/^\(T[0-9]*\),\(S[0-9]*\),tuned,.*/\1_\2.html/p' run/slots.csv | while read -r f; do [ -e "run/slots/$f" ] && echo "$f"; done | head -n 1)" slot.html
"$program" -q demo --out demo >/dev/null 2>&1 || [ $? = 1 ]
cp demo/diagnosis/report.html diagnose.html
cp demo/machines.html machines.html
for machine in stage galvo vcm; do
    cp -r "$root/examples/$machine" "$machine"
    (cd "$machine" && sed -n 's/^servotune //p' README.md | while read -r line; do "$program" -q $line >/dev/null || [ $? = 1 ]; done)
    cp "$machine/report.html" "worked_$machine.html"
done

# A window is at least 500 px wide: a phone stands in the middle of one.
take() { # page, window, scheme, picture
    "$browser" --headless --no-sandbox --disable-gpu --hide-scrollbars --user-data-dir="$work/profile" --window-size="$2" \
        --blink-settings=preferredColorScheme="$3" --virtual-time-budget=3000 --screenshot="$work/shot.png" "file://$1" >/dev/null 2>&1
    cwebp -quiet -q 60 -m 6 "$work/shot.png" -o "$4"
}
for name in identify margins tune slot verify simulate budget pareto train classify machines fleet diagnose; do
    printf '<!doctype html><body style="margin:0;background:#777"><iframe style="display:block;margin:0 auto;border:0;width:390px;height:1200px" src="%s.html"></iframe></body>' "$name" >"$name.phone.html"
    for scheme in light dark; do
        number=1
        [ $scheme = dark ] && number=0
        take "$work/$name.html" 1300,1400 $number "$out/${name}_desk_$scheme.webp"
        take "$work/$name.phone.html" 500,1200 $number "$out/${name}_phone_$scheme.webp"
    done
done
for machine in stage galvo vcm; do
    take "$work/worked_$machine.html" 1100,1500 1 "$out/worked_$machine.webp"
done
echo "$(ls "$out" | wc -l) pictures in $out"
