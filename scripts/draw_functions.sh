#!/usr/bin/env bash
# Draws the pictures of docs/functions.md from the examples of the functions.
#
#   scripts/draw_functions.sh PROGRAM
set -eu
cd "$(dirname "$0")/.."
program=$(realpath "$1")
folder=docs/images
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
grep -o 'images/hf[A-Za-z0-9_]*' docs/functions.md | sort -u | while IFS=/ read -r _ name; do
  "$program" functions "$name" --example > "$scratch/$name.hf"
  "$program" render "$scratch/$name.hf" --box=-1.7,-1.7,-1.7,1.7,1.7,1.7 \
    --camera 2.6,-3.4,2.6,0,0,0 --size 220x180 --no-legend \
    --background grey --quiet -o "$folder/$name.png" < /dev/null
done
