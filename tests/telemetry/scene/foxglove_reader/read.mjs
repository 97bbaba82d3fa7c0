// Prints what a recording holds: node read.mjs FILE
import { messages, open } from "./recording.mjs";

const recording = await open(process.argv[2]);
const told = { topics: {}, metadata: {}, attachments: {} };
for (const channel of recording.reader.channelsById.values()) {
  const type = recording.types.get(channel.id);
  told.topics[channel.topic] = { schema: type.fullName.slice(1), messages: [] };
}
const options = { defaults: true, arrays: true, longs: Number, enums: Number, bytes: Array };
for await (const { topic, logTime, message } of messages(recording)) {
  const content = message.$type.toObject(message, options);
  told.topics[topic].messages.push({ time_s: Number(logTime) / 1e9, ...content });
}
for await (const record of recording.reader.readMetadata()) {
  told.metadata[record.name] = Object.fromEntries(record.metadata);
}
for await (const record of recording.reader.readAttachments()) {
  told.attachments[record.name] = Buffer.from(record.data).toString("utf8");
}
process.stdout.write(JSON.stringify(told));
