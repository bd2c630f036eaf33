#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Trials as jobs of a real Slurm: installs slurm-wlm and munge, starts a controller and one node on
# this machine in a folder of its own, hands trials to its partition, kills a job in the middle, and
# compares trials.csv with that of one machine. Needs root.
#   tests/cluster/slurm.sh [PYTHON]     PYTHON: one with blindcorner[slurm]; default: a venv is made
# Exit status 1 where the files differ.
set -euo pipefail
unset CDPATH
cd -- "$(dirname -- "${BASH_SOURCE[0]}")/../.."

[[ "$(id -u)" == 0 ]] || { echo "slurm.sh: found another user, accepted: root" >&2; exit 2; }
program=$PWD/build/release/blindcorner
[[ -x "$program" ]] || { echo "slurm.sh: build $program first (./bootstrap.sh fit)" >&2; exit 2; }
# shellcheck source=/dev/null
source ./bootstrap.sh
install_packages slurm-wlm munge python3-dev python3-venv

python=${1:-}
if [[ -z "$python" ]]; then
  venv=build/cluster/venv
  [[ -x "$venv/bin/python" ]] || python3 -m venv "$venv"
  cmake --install build/release --prefix "$PWD/build/cluster/prefix" >/dev/null
  "$venv/bin/pip" install --quiet --retries 1 ".[slurm]" \
    -C "cmake.define.blindcorner_ROOT=$PWD/build/cluster/prefix"
  python=$PWD/$venv/bin/python
fi

work=$(mktemp -d)
started=()
finish() {
  for pid in "${started[@]}"; do kill "$pid" 2>/dev/null || true; done
  for pid in "${started[@]}"; do wait "$pid" 2>/dev/null || true; done
  rm -rf "$work"
}
trap finish EXIT

# A munge of its own, beside one that the machine may run.
dd if=/dev/urandom of="$work/munge.key" bs=128 count=1 status=none
chmod 400 "$work/munge.key"
chmod 755 "$work"
munged --foreground --force --key-file="$work/munge.key" --socket="$work/munge.socket" \
  --pid-file="$work/munge.pid" --log-file="$work/munge.log" --seed-file="$work/munge.seed" &
started+=($!)

host=$(hostname -s)
mkdir -p "$work/state" "$work/spool" "$work/jobs"
cat >"$work/slurm.conf" <<CONF
ClusterName=blindcorner
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=16817
SlurmdPort=16818
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket=$work/munge.socket
CredType=cred/munge
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd.pid
SlurmctldLogFile=$work/slurmctld.log
SlurmdLogFile=$work/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
ReturnToService=2
MpiDefault=none
NodeName=$host NodeAddr=127.0.0.1 CPUs=2 RealMemory=2000 State=UNKNOWN
PartitionName=small Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF
export SLURM_CONF=$work/slurm.conf
slurmctld -D &
started+=($!)
slurmd -D &
started+=($!)
for _ in $(seq 60); do
  [[ "$(sinfo -h -o %T 2>/dev/null)" == idle* ]] && break
  sleep 0.5
done
sinfo

drive=scenes/robot_drive.json
"$program" trials "$drive" -n 60 --perception los,oracle -o "$work/one" >/dev/null
"$python" -m blindcorner.cluster trials "$drive" -n 60 --perception los,oracle -o "$work/slurm" \
  --slurm "partition=small,cores=1,memory=900MB,jobs=2,walltime=00:10:00,log_directory=$work/jobs" &
run=$!
for _ in $(seq 600); do
  [[ "$(cat "$work/slurm/journal.csv" 2>/dev/null | wc -l)" -gt 8 ]] && break
  sleep 0.05
done
job=$(squeue -h -t running -o %i | head -n 1)
echo "slurm.sh: kills job $job"
scancel --signal=KILL --full "$job"
wait "$run"
cmp "$work/one/trials.csv" "$work/slurm/trials.csv"
echo "slurm.sh: trials.csv is that of one machine, after job $job was killed"
