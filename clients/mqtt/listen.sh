#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Prints the job events that a planning service (`sightline serve --mqtt`) publishes: topic and JSON.
#
#   listen.sh [TYPE]          accepted, progress, done, failed or cancelled; default: all
#
# SIGHTLINE_MQTT_HOST (localhost), SIGHTLINE_MQTT_PORT (1883; 8883 with TLS), SIGHTLINE_MQTT_PREFIX
# (sightline), SIGHTLINE_MQTT_CA (PEM file, turns on TLS). User name and password belong into
# mosquitto_sub's own options file (`-u NAME`, `-P PASSWORD` in ~/.config/mosquitto_sub), since
# others can read command lines.
#
# Events come at least once: keep the largest event_id and leave out what is not greater. With a
# fixed client id, quality of service 1 and no clean session, the broker keeps what was published
# while this was not running.
set -euo pipefail

type=${1:-+}
case $type in
  + | accepted | progress | done | failed | cancelled) ;;
  *) echo "usage: listen.sh [accepted|progress|done|failed|cancelled]" >&2; exit 2 ;;
esac
prefix=${SIGHTLINE_MQTT_PREFIX:-sightline}
tls=()
port=1883
if [[ -n ${SIGHTLINE_MQTT_CA:-} ]]; then
  tls=(--cafile "$SIGHTLINE_MQTT_CA")
  port=8883
fi
exec mosquitto_sub --host "${SIGHTLINE_MQTT_HOST:-localhost}" \
  --port "${SIGHTLINE_MQTT_PORT:-$port}" "${tls[@]}" --id "sightline-listen-$(hostname)" --disable-clean-session --qos 1 \
  --topic "$prefix/jobs/+/$type" --topic "$prefix/status" -F '%t %p'
