// A recording as Foxglove's own libraries see it: every message of every channel, decoded.
import { readFile } from "node:fs/promises";

import { McapIndexedReader } from "@mcap/core";
import { loadDecompressHandlers, protobufFromBinaryDescriptor } from "@mcap/support";

class Bytes {
  #content;
  constructor(content) {
    this.#content = content;
  }
  async size() {
    return BigInt(this.#content.length);
  }
  async read(offset, size) {
    return new Uint8Array(this.#content.subarray(Number(offset), Number(offset + size)));
  }
}

export async function open(path) {
  const reader = await McapIndexedReader.Initialize({
    readable: new Bytes(await readFile(path)),
    decompressHandlers: await loadDecompressHandlers(),
  });
  const types = new Map();
  for (const channel of reader.channelsById.values()) {
    const schema = reader.schemasById.get(channel.schemaId);
    if (channel.messageEncoding !== "protobuf" || schema?.encoding !== "protobuf") {
      throw new Error(`${channel.topic} is not protobuf`);
    }
    const type = protobufFromBinaryDescriptor(schema.data).lookupType(schema.name);
    type.resolveAll();
    types.set(channel.id, type);
  }
  return { reader, types };
}

/** Yields { topic, logTime, message } in the order of time. */
export async function* messages({ reader, types }) {
  for await (const record of reader.readMessages()) {
    yield {
      topic: reader.channelsById.get(record.channelId).topic,
      logTime: record.logTime,
      message: types.get(record.channelId).decode(record.data),
    };
  }
}
