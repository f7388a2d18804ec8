// Khronos' glTF validator: for each FILE its issues, [code, pointer, severity], as one JSON array on stdout.
//
//     node validate.mjs FILE...
import { readFile } from "node:fs/promises";
import { dirname, join } from "node:path";
import validator from "gltf-validator";

const EVERY_ONE = 0; // issues; the validator's own default ends after some

async function issues(file) {
  const beside = async (uri) => new Uint8Array(await readFile(join(dirname(file), decodeURIComponent(uri))));
  const bytes = new Uint8Array(await readFile(file));
  const options = { uri: file, maxIssues: EVERY_ONE, externalResourceFunction: beside };
  const report = await validator.validateBytes(bytes, options);
  return report.issues.messages.map(({ code, pointer, severity }) => [code, pointer ?? "", severity]);
}

const all = [];
for (const file of process.argv.slice(2)) {
  all.push(await issues(file));
}
console.log(JSON.stringify(all));
