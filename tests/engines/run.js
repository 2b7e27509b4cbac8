// Runs models in one of the JavaScript builds of ONNX Runtime, with the latents of their test vectors:
//     node run.js PACKAGE MODEL VECTORS [MODEL VECTORS ...] > muons.json
// Of a family the vectors may name a depth, `depth_m`.

import { readFileSync } from "node:fs";
import { atDepth } from "../../docs/live/family.js";

const [name, ...files] = process.argv.slice(2);
const ort = await import(name);
ort.env.wasm.numThreads = 1;

async function run(model, vectors) {
    const { draws, latent, depth_m } = JSON.parse(readFileSync(vectors));
    const contents = new Uint8Array(readFileSync(model));
    const session = await ort.InferenceSession.create(
        depth_m === undefined ? contents : atDepth(contents.buffer, depth_m),
    );
    const feed = new ort.Tensor("float32", Float32Array.from(latent), [draws, latent.length / draws]);
    const muons = await session.run({ latent: feed });
    return Object.fromEntries(Object.entries(muons).map(([output, { data }]) => [output, Array.from(data)]));
}

const all = {};
for (let k = 0; k < files.length; k += 2) {
    all[files[k]] = await run(files[k], files[k + 1]);
}
console.log(JSON.stringify(all));
