#!/usr/bin/env bash
# Bakes, checks, compares and reports, for any CI service. Everything is written before the verdict is told.
#   PIPELINE [pipeline.toml]  BASELINE [as the pipeline says]  MAX_GROWTH [5]  MAX_UGLIER [10]  VIEWER [false]
#   FOLDER [lodbake-report]   where the reports go
# The exit code is that of the worst step: 3 something could not be baked or judged, 1 over budget or worse than before.
# On GitHub it is put into the step's output `code` instead, so that later steps run.
set -uo pipefail

pipeline="${PIPELINE:-pipeline.toml}"
folder="${FOLDER:-lodbake-report}"
limits=(--max-growth "${MAX_GROWTH:-5}" --max-uglier "${MAX_UGLIER:-10}")
baseline=()
[ -z "${BASELINE:-}" ] || baseline=(--baseline "$BASELINE")
worst=0

note() { # the worst exit code so far
  local code=$?
  [ "$code" -le "$worst" ] || worst=$code
}

lodbake bake "$pipeline" || note
lodbake check "$pipeline" "${baseline[@]}" || note
if [ -n "${BASELINE:-}" ]; then
  lodbake diff "$BASELINE" --pipeline "$pipeline" "${limits[@]}" || note
fi
viewer=()
[ "${VIEWER:-false}" != true ] || viewer=(--viewer)
lodbake report "$pipeline" "${baseline[@]}" "${limits[@]}" "${viewer[@]}" \
  -o "$folder/report.html" -o "$folder/report.md" -o "$folder/report.sarif" -o "$folder/junit.xml" \
  -o "$folder/report.json" || note
if [ -n "${GITHUB_ACTIONS:-}" ]; then
  lodbake report "$pipeline" "${baseline[@]}" "${limits[@]}" --format github || note
fi
if [ -n "${GITHUB_OUTPUT:-}" ]; then
  [ ! -d "$folder" ] || echo "folder=$folder" >>"$GITHUB_OUTPUT"
  echo "code=$worst" >>"$GITHUB_OUTPUT"
  exit 0
fi
exit "$worst"
