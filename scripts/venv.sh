# shellcheck shell=bash
# Virtual environments of Python, outside of the clone: sourced by test.sh and release.sh.

# make_venv FILE...: sets `venv` to the folder of the environment with these requirements, and makes
# it unless it is there; it is another one whenever the files change. False if it cannot be made.
make_venv() {
  local file arguments=()
  for file; do arguments+=(-r "$file"); done
  venv=${XDG_CACHE_HOME:-$HOME/.cache}/isoform/venv-$(cat "$@" | sha256sum | cut -c1-16)
  if [ -e "$venv/filled" ]; then return; fi
  rm -rf "$venv"
  mkdir -p "${venv%/*}" && python3 -m venv "$venv" &&
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check "${arguments[@]}" &&
    touch "$venv/filled"
}
