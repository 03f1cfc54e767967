#!/usr/bin/env bash
# One comment on a pull request, written anew at each run: it is known by the report's first line.
#   REPORT (a Markdown file)  REPOSITORY (owner/name)  NUMBER (of the pull request)  GH_TOKEN; needs `gh` and `jq`
set -euo pipefail

mark="$(head -n 1 "$REPORT")"
body="$(mktemp)"
trap 'rm -f "$body"' EXIT
jq -n --rawfile body "$REPORT" '{body: $body}' >"$body"
comment="$(gh api --paginate "repos/$REPOSITORY/issues/$NUMBER/comments" \
  | jq -r --arg mark "$mark" '.[] | select(.body | startswith($mark)) | .id' | head -n 1)"
if [ -n "$comment" ]; then
  gh api --method PATCH "repos/$REPOSITORY/issues/comments/$comment" --input "$body" >/dev/null
else
  gh api --method POST "repos/$REPOSITORY/issues/$NUMBER/comments" --input "$body" >/dev/null
fi
