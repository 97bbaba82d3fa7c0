// Compiles the scripts of a layout as Foxglove does, strictly and against the types of its schemas and of the
// recording, and runs them over the recording: node run_scripts.mjs LAYOUT FILE
import { readFile } from "node:fs/promises";
import path from "node:path";
import { fileURLToPath } from "node:url";

import ts from "typescript";

import { messages, open } from "./recording.mjs";

const HERE = path.dirname(fileURLToPath(import.meta.url));
const NUMBER_ARRAYS = { double: "Float64Array", float: "Float32Array", uint32: "Uint32Array" };

/** The module "./types" that Foxglove makes from the topics at hand. */
function typesOf({ reader, types }) {
  const fields = [];
  for (const channel of reader.channelsById.values()) {
    const type = types.get(channel.id);
    if (type.fullName.startsWith(".inspection.")) {
      fields.push(`${JSON.stringify(channel.topic)}: { ${type.fieldsArray.map(declared).join("; ")} };`);
    }
  }
  return `import { Time } from "@foxglove/schemas";
    type Messages = { ${fields.join("\n")} };
    export type Input<T extends keyof Messages> = { topic: T; receiveTime: Time; message: Messages[T] };`;
}

function declared(field) {
  const single = field.type === "bytes" ? "Uint8Array" : "number";
  return `${field.name}: ${field.repeated ? NUMBER_ARRAYS[field.type] : single}`;
}

/** The scripts as JavaScript, by name; whatever the compiler complains of is an error. */
function compiled(scripts, types) {
  const names = Object.keys(scripts);
  const sources = new Map(names.map((name) => [path.join(HERE, `${name}.ts`), scripts[name].sourceCode]));
  sources.set(path.join(HERE, "types.ts"), types);
  const options = {
    strict: true,
    target: ts.ScriptTarget.ES2022,
    module: ts.ModuleKind.CommonJS,
    lib: ["lib.es2022.d.ts"],
    types: [],
  };
  const host = ts.createCompilerHost(options);
  const { fileExists, getSourceFile } = host;
  host.fileExists = (file) => sources.has(path.normalize(file)) || fileExists.call(host, file);
  host.getSourceFile = (file, target) => {
    const own = sources.get(path.normalize(file));
    return own === undefined
      ? getSourceFile.call(host, file, target)
      : ts.createSourceFile(file, own, target, true);
  };
  const code = {};
  host.writeFile = (file, text) => {
    code[path.basename(file, ".js")] = text;
  };
  const program = ts.createProgram([...sources.keys()], options, host);
  const complaints = ts.getPreEmitDiagnostics(program);
  if (complaints.length > 0) {
    throw new Error(ts.formatDiagnostics(complaints, host));
  }
  program.emit();
  return names.map((name) => code[name]);
}

function loaded(code) {
  const module = {};
  const refuse = (id) => {
    throw new Error(`a script may import types alone, not ${id}`);
  };
  new Function("exports", "require", code)(module, refuse);
  return module;
}

const layout = JSON.parse(await readFile(process.argv[2], "utf8"));
const recording = await open(process.argv[3]);
const scripts = compiled(layout.userNodes, typesOf(recording)).map(loaded);
const told = Object.fromEntries(scripts.map((script) => [script.output, []]));
for await (const { topic, logTime, message } of messages(recording)) {
  const receiveTime = { sec: Number(logTime / 1_000_000_000n), nsec: Number(logTime % 1_000_000_000n) };
  for (const script of scripts.filter(({ inputs }) => inputs.includes(topic))) {
    const made = script.default({ topic, receiveTime, message }, layout.globalVariables);
    if (made !== undefined) {
      told[script.output].push({ time_s: receiveTime.sec, after: topic, message: structuredClone(made) });
    }
  }
}
process.stdout.write(JSON.stringify(told));
