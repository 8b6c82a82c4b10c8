#!/usr/bin/env bash
# The scenes of the repository are those that scripts/make-scenes writes.
set -euo pipefail
cd "$(dirname "$0")/../.."
made=$(mktemp -d)
trap 'rm -r "$made"' EXIT
scripts/make-scenes "$made"
for file in $(cd "$made" && find . -type f); do cmp "$made/$file" "scenes/$file"; done
