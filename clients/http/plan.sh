#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Asks a planning service for a plan of examples/cylinder_head with curl alone, follows it, and
# saves report.html and plan.json.
#
#   plan.sh URL [OUT_FOLDER [REQUEST_ID]]        e.g. plan.sh http://127.0.0.1:8080 plan order-17
#
# The same REQUEST_ID again gives the same job: a script that was interrupted goes on with it.
# SIGHTLINE_TOKEN: the client's token. SIGHTLINE_ROOT_CERTIFICATES: PEM file of who signed the
# server's certificate.
set -euo pipefail

url=${1:?usage: plan.sh URL [OUT_FOLDER [REQUEST_ID]]}
out=${2:-plan}
request_id=${3:-$(cat /proc/sys/kernel/random/uuid)}
example=$(cd "$(dirname "${BASH_SOURCE[0]}")/../../examples/cylinder_head" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Options of every call; the token in a file, since others can read command lines.
options=(--silent --show-error --connect-timeout 10)
if [[ -n ${SIGHTLINE_TOKEN:-} ]]; then
  (umask 077 && printf 'header = "Authorization: Bearer %s"\n' "$SIGHTLINE_TOKEN" >"$work/curlrc")
  options+=(--config "$work/curlrc")
fi
[[ -z ${SIGHTLINE_ROOT_CERTIFICATES:-} ]] || options+=(--cacert "$SIGHTLINE_ROOT_CERTIFICATES")

# One call, tried again while the service restarts; errors are shown as the service says them.
call() {
  local code
  code=$(curl "${options[@]}" --retry 5 --retry-all-errors --max-time 600 \
    --output "$work/answer" --write-out '%{http_code}' "$@")
  [[ $code == 2?? ]] || { echo "HTTP $code: $(cat "$work/answer")" >&2; return 1; }
  cat "$work/answer"
}

# A field of the job whose value is text.
text_field() {
  tr -d '\n' | sed -E "s/.*\"$1\": *\"([^\"]*)\".*/\1/; t; d"
}

printf '{"kind": "plan", "inspection": %s}' "$(cat "$example/inspection.json")" >"$work/task.json"
job_id=$(call --header "Idempotency-Key: $request_id" \
  --form "task=<$work/task.json;type=application/json" \
  --form "file=@$example/cylinder_head.glb;filename=cylinder_head.glb" \
  "$url/v1/jobs" | text_field job_id)
[[ -n $job_id ]] || { echo "the answer has no job_id: $(cat "$work/answer")" >&2; exit 1; }
echo "job $job_id of request $request_id"

# Events until the job is finished; a stream that breaks is asked for again.
state=QUEUED
while [[ $state == QUEUED || $state == RUNNING ]]; do
  curl "${options[@]}" --fail --no-buffer --max-time 60 --header 'Accept: text/event-stream' \
    "$url/v1/jobs/$job_id/events" 2>/dev/null | sed -n 's/^event: *//p' || sleep 1
  state=$(call "$url/v1/jobs/$job_id" | text_field state)
done
echo "$state"
if [[ $state != SUCCEEDED ]]; then
  call "$url/v1/jobs/$job_id" >&2
  exit 1
fi

mkdir -p "$out"
for name in report.html plan.json; do
  call "$url/v1/jobs/$job_id/results/$name" >"$out/$name.part"
  mv "$out/$name.part" "$out/$name"
  echo "saved $out/$name"
done
