#!/usr/bin/env bash
# Synthesizes every shipped gain file again: all models, all shipped rates.
set -euo pipefail
cd "$(dirname "$0")/.."
for model in gains/models/*.yaml; do
  for rate in 50 100 200 400; do
    "${H2NAV:-.venv/bin/h2nav}" synthesize "$model" --rate "$rate" \
      -o "gains/$(basename "$model" .yaml)_${rate}hz.yaml" --json >/dev/null
  done
done
"${H2NAV:-.venv/bin/h2nav}" certify gains/*.yaml
