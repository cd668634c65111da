#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Asks a planning service for a plan of examples/cylinder_head from the shell by gRPC reflection,
# follows it, and saves report.html and plan.json.
#
#   plan.sh ADDRESS [OUT_FOLDER [REQUEST_ID]]
#
# The same REQUEST_ID again gives the same job. SIGHTLINE_TOKEN: the client's token.
# SIGHTLINE_ROOT_CERTIFICATES: PEM file, turns on TLS. SIGHTLINE_GRPC_CALL: the program that calls,
# default grpc_call beside this script. grpcurl has the same options, but this script is tested with
# grpc_call alone.
set -euo pipefail

address=${1:?usage: plan.sh ADDRESS [OUT_FOLDER [REQUEST_ID]]}
out=${2:-plan}
request_id=${3:-$(cat /proc/sys/kernel/random/uuid)}
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
example=$(cd "$here/../../examples/cylinder_head" && pwd)
part=$example/cylinder_head.glb
service=sightline.v1.PlanningService

options=(-plaintext)
[[ -z ${SIGHTLINE_ROOT_CERTIFICATES:-} ]] || options=(-cacert "$SIGHTLINE_ROOT_CERTIFICATES")
# The variable's name goes into the command line, not the token.
# shellcheck disable=SC2016
[[ -z ${SIGHTLINE_TOKEN:-} ]] ||
  options+=(-expand-headers -H 'authorization: Bearer ${SIGHTLINE_TOKEN}')

# call METHOD: request on standard input, answers on standard output.
call() {
  "${SIGHTLINE_GRPC_CALL:-$here/grpc_call}" "${options[@]}" -d @ "$address" "$service/$1"
}

# A field whose value is text, under its own name (job_id) or in camel case (jobId).
text_field() {
  local camel
  camel=$(sed -E 's/_(.)/\U\1/g' <<<"$1")
  sed -unE "s/.*\"($1|$camel)\": *\"([^\"]*)\".*/\2/p"
}

digest=$(sha256sum "$part" | cut -d ' ' -f 1)
{
  printf '{"header": {"size_bytes": %d, "digest": "%s"}}\n' "$(stat -c %s "$part")" "$digest"
  split --bytes=1M --filter='printf "{\"chunk\": \"%s\"}\n" "$(base64 -w 0)"' "$part"
} | call UploadFile >/dev/null

job_id=$(printf '{"request_id": "%s", "task": {"kind": "plan", "inspection": %s},
  "files": [{"name": "cylinder_head.glb", "digest": "%s"}]}' \
  "$request_id" "$(cat "$example/inspection.json")" "$digest" |
  call CreatePlanningJob | text_field job_id)
echo "job $job_id of request $request_id"

# Watched anew when the service restarts; gives up after ten tries in a row that said nothing.
tries=0
state=QUEUED
while [[ $state == QUEUED || $state == RUNNING ]]; do
  last=$(printf '{"job_id": "%s"}' "$job_id" | call WatchPlanningJob | text_field state |
    tee /dev/stderr | tail -n 1) || true
  if [[ -n $last ]]; then
    state=$last
    tries=0
  elif ((++tries >= 10)); then
    exit 1
  else
    sleep 2
  fi
done
if [[ $state != SUCCEEDED ]]; then
  printf '{"job_id": "%s"}' "$job_id" | call GetPlanningJob >&2
  exit 1
fi

mkdir -p "$out"
for name in report.html plan.json; do
  # Every chunk is padded base64 of its own.
  printf '{"job_id": "%s", "name": "%s"}' "$job_id" "$name" | call StreamResult |
    text_field chunk | while read -r chunk; do base64 -d <<<"$chunk"; done >"$out/$name.part"
  mv "$out/$name.part" "$out/$name"
  echo "saved $out/$name"
done
