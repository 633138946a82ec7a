# Sourced by the other tools: the project's own virtual environment in .venv, made when it is missing
# and brought up to date when pyproject.toml has changed. need EXTRAS: 'test', 'dev' or ''.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
venv=$root/.venv
say() { echo "$(basename "$0"): $*" >&2; }
die() { say "$*"; exit 1; }

# apt NAME...: install Debian packages; quietly does nothing that is there already.
apt() {
  command -v apt-get >/dev/null || die "needs $*, and there is no apt-get here: install them by hand"
  [ "$(id -u)" = 0 ] || die "needs $*: run as root, or 'apt-get install $*' first"
  say "installing $*"
  { apt-get -q update || say "apt-get update failed; going on with the lists there are"; } >/dev/null 2>&1
  DEBIAN_FRONTEND=noninteractive apt-get -q install -y --no-install-recommends "$@" >/dev/null || die "cannot install $*"
}

# install_time EXTRAS: how long pip takes for them with a fast network.
install_time() {
  case $1 in
    test | dev | fuzz | mutation) echo "two to five minutes, 1 GB" ;;
    *) echo "one to three minutes" ;;
  esac
}

python_new_enough() { "$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; }

# work_time PYTHON: processor time of a little work, us; nothing where it cannot make an environment.
work_time() {
  "$1" - 2>/dev/null <<'END'
import ensurepip, time, timeit
setup = """
class Place:
    def __init__(self, number): self.number = number
    def after(self, step): return Place((self.number + step) % 97)
"""
work = """
place = Place(1)
for step in range(3000): place = place.after(step)
"""
print(round(min(timeit.repeat(work, setup, time.process_time, repeat=99, number=1)) * 1e6))
END
}

# find_python: $PYTHON; else the first that is new enough, or one that is much faster: built without
# the compiler's profile, as pyenv does by default, it takes half as long again for the tests. Each is
# timed several times, in turns: what else runs on the machine slows one down for a moment.
find_python() {
  local candidate time_us turn found='' candidates=()
  local -A least_us=()
  for candidate in ${PYTHON:-python3 python3.13 python3.12 python3.11 /usr/bin/python3}; do
    if python_new_enough "$candidate"; then candidates+=("$candidate") least_us[$candidate]=1000000; fi
  done
  [ ${#candidates[@]} -gt 0 ] || die "needs Python 3.11 or later (set PYTHON to one)"
  for turn in 1 2 3; do
    for candidate in "${candidates[@]}"; do
      time_us=$(work_time "$candidate") || true
      if [ "${time_us:-1000000}" -lt "${least_us[$candidate]}" ]; then least_us[$candidate]=$time_us; fi
    done
  done
  for candidate in "${candidates[@]}"; do
    if [ -z "$found" ] || [ $((least_us[$candidate] * 5)) -lt $((least_us[$found] * 4)) ]; then
      found=$candidate
    fi
  done
  echo "$found"
}

need() {
  local extras=$1 python stamp wanted
  stamp=$venv/installed-${extras:-plain}
  if ! python_new_enough "$venv/bin/python"; then
    python=$(find_python)
    say "making $venv with $("$python" --version)"
    rm -rf "$venv"
    # Debian splits venv off Python; without its ensurepip the first attempt fails.
    "$python" -m venv "$venv" >/dev/null 2>&1 || { rm -rf "$venv"; apt python3-venv; "$python" -m venv "$venv"; }
    # The pip that comes with Python 3.11 seeks for minutes what fits together, a newer one for seconds.
    "$venv/bin/python" -m pip install -q --disable-pip-version-check --upgrade pip >/dev/null 2>&1 ||
      say "pip could not be brought up to date; going on with the one there is"
  fi
  wanted=$(sha256sum <"$root/pyproject.toml" | cut -d' ' -f1)
  if [ "$(cat "$stamp" 2>/dev/null)" != "$wanted" ] || ! "$venv/bin/python" -c 'import adhesion_can' 2>/dev/null; then
    say "installing adhesion-can${extras:+ with its extra '$extras'} (once; $(install_time "$extras"))"
    "$venv/bin/python" -m pip install -q --disable-pip-version-check -e "$root${extras:+[$extras]}" 2>&1 |
      { grep -v -E '^(WARNING: Location|\[notice\])' || true; } >&2 || die "cannot install adhesion-can"
    echo "$wanted" >"$stamp"
  fi
  export PATH=$venv/bin:$PATH
}
