#!/usr/bin/env bash
# v5 on scenes that its table was not fitted to (docs/results/v5.md): bash docs/unseen.sh DATASETS
# Prints, for each set of scenes, right and wrong cells of v5, v3, bm and sgm (of the faults: v5 alone, as they are 16 234
# pairs), and the fraction of right cells by v5's probability. The reports stay in reports/unseen-*.
set -euo pipefail
datasets="$(realpath "${1:?the folder of the data sets}")"
cd "$(dirname "$0")/.."
svl() { cargo run --profile "${PROFILE:-release}" --quiet --locked -- "$@"; }
score() {
  local name="$1"
  shift
  svl score "$@" --algo all=v5:confidence=0.001 --rerun none --quiet -o "reports/unseen-$name" >/dev/null
}

others=(--algo v3 --algo bm --algo sgm)
score playground scenarios/eth3d.toml "${others[@]}" --data "$datasets" --scenes eth3d-playground_1l
score street scenarios/kitti2012.toml "${others[@]}" --data "$datasets" --scenes kitti2012-000000_10
svl score scenarios/drive.toml --algo truth --seeds 101..104 --quiet -o reports/unseen-drive >/dev/null
score courses reports/unseen-drive/course-*-truth.mcap "${others[@]}"
score worlds scenarios/worlds.toml "${others[@]}"
score shapes scenarios/shapes.toml "${others[@]}"
stress=()
for kind in roll exposure dark low_light glare defocus defocus_both motion_blur dirt drop jpeg skew; do
  stress+=(--stress "$kind")
done
score faults scenarios/arena.toml --seeds 11 "${stress[@]}"

# Cells with truth; a cell of v5 is known from 0.85 on. Unperturbed pairs of the faults' seed are left out.
for name in playground street courses worlds shapes faults; do
  echo
  awk -F, -v name="$name" '
    NR == 1 { for (i = 1; i <= NF; i++) column[$i] = i; next }
    name == "faults" && $column["stress"] == "" { next }
    {
      verdict = $column["verdict"]; algorithm = $column["algorithm"]; p = $column["probability"]
      if (verdict == "no-truth") next
      if (algorithm == "all") {
        right = verdict == "right"
        if (p != "") { b = p < 0.6 ? 0 : p < 0.85 ? 1 : p < 0.95 ? 2 : p < 0.99 ? 3 : 4
          cells[b]++; sum[b] += p; good[b] += right }
        if (p < 0.85) verdict = "unknown"
        algorithm = "v5"
      }
      all[algorithm]++; count[algorithm, verdict]++
    }
    END {
      printf "%s: %d cells with truth\n| algorithm | right, %% | wrong, %% |\n|---|---:|---:|\n", name, all["v5"]
      n = split("v5 v3 bm sgm", names, " ")
      for (i = 1; i <= n; i++) if (all[a = names[i]])
        printf "| %s | %.1f | %.1f |\n", a, 100 * count[a, "right"] / all[a], 100 * count[a, "wrong"] / all[a]
      print "\n| predicted, % | cells | mean, % | observed right, % |\n|---|---:|---:|---:|"
      split("0 60 85 95 99 100", ends, " ")
      for (b = 0; b < 5; b++) if (cells[b])
        printf "| %d to %d | %d | %.1f | %.1f |\n", ends[b + 1], ends[b + 2], cells[b], 100 * sum[b] / cells[b],
          100 * good[b] / cells[b]
    }' "reports/unseen-$name/cells.csv"
done
