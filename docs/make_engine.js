/** Puts what the live page runs on into docs/live/engine: `npm run build`. npm brings it. */

import { copyFile, mkdir, readFile, writeFile } from "node:fs/promises";
import wabt from "wabt";

const HERE = new URL("live/", import.meta.url);
const ENGINE = new URL("engine/", HERE);
const ONNXRUNTIME = new URL("./", import.meta.resolve("onnxruntime-web/wasm"));

await mkdir(ENGINE, { recursive: true });
for (const name of ["ort.wasm.bundle.min.mjs", "ort-wasm-simd-threaded.wasm"]) {
    await copyFile(new URL(name, ONNXRUNTIME), new URL(name, ENGINE));
}

const { parseWat } = await wabt();
const random = parseWat("random.wat", await readFile(new URL("random.wat", HERE)));
random.validate();
await writeFile(new URL("random.wasm", ENGINE), random.toBinary({}).buffer);
