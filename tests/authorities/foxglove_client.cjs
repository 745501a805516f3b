// Subscribes to every channel with Foxglove's own client; prints what came of the wanted ones.
// Usage: node foxglove_client.cjs PORT TOPIC...
"use strict";
const { FoxgloveClient } = require("@foxglove/ws-protocol");
const { WebSocket } = require("ws");

const [port, ...wanted] = process.argv.slice(2);
const client = new FoxgloveClient({
  ws: new WebSocket(`ws://127.0.0.1:${port}`, ["foxglove.sdk.v1"]),
});
const channels = new Map();
const seen = { server: null, parameters: null, topics: {} };

function endWhenComplete() {
  if (seen.parameters !== null && wanted.every((topic) => topic in seen.topics)) {
    console.log(JSON.stringify(seen));
    process.exit(0);
  }
}

client.on("error", (error) => {
  console.error(String(error));
  process.exit(1);
});
client.on("serverInfo", (info) => {
  seen.server = info;
  client.getParameters([], "all");
});
client.on("advertise", (advertised) => {
  for (const channel of advertised) {
    channels.set(client.subscribe(channel.id), channel);
  }
});
client.on("parameterValues", ({ parameters }) => {
  seen.parameters = Object.fromEntries(parameters.map(({ name, value }) => [name, value]));
  endWhenComplete();
});
client.on("message", ({ subscriptionId, timestamp, data }) => {
  const channel = channels.get(subscriptionId);
  seen.topics[channel.topic] ??= {
    encoding: channel.encoding,
    schemaName: channel.schemaName,
    schema: channel.schema,
    unixNs: String(timestamp),
    data: Buffer.from(data.buffer, data.byteOffset, data.byteLength).toString("base64"),
  };
  endWhenComplete();
});
