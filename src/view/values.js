// Values of frames, and their colours. The page's script consists of this file, cloud.js and page.js, in this order.
"use strict";
(() => {
    const bytesOf = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const floatsOf = (text) => new Float32Array(bytesOf(text).buffer);
    const { turbo: turboText, viridis: viridisText, colours } = document.body.dataset;
    const [turbo, viridis] = [bytesOf(turboText), bytesOf(viridisText)];
    // The colours of no return and of differences.
    const { nothing: NOTHING, same: SAME, less: LESS, more: MORE, vanished: GONE, appeared: NEW, unseen: UNSEEN } = JSON.parse(colours);

    function element(name, text, attributes = {}) {
        const made = document.createElement(name);
        made.textContent = text;
        for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
        return made;
    }

    // ---- Unpacking ----

    async function unpack({ kind, count, neighbour, data }) {
        const stream = new Blob([bytesOf(data)]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
        const planes = new Uint8Array(await new Response(stream).arrayBuffer());
        const bits = { f32: new Uint32Array(count), u32: new Uint32Array(count), u16: new Uint16Array(count), i8: new Uint8Array(count) }[kind];
        for (let byte = 0; byte < bits.BYTES_PER_ELEMENT; byte++) {
            for (let i = 0, from = byte * count; i < count; i++) bits[i] |= planes[from + i] << (8 * byte);
        }
        for (let i = neighbour; i < count; i++) bits[i] += bits[i - neighbour];
        return kind === "f32" ? new Float32Array(bits.buffer) : kind === "i8" ? new Int8Array(bits.buffer) : bits;
    }

    async function unpackChannels(channels) {
        for (const channel of channels ?? []) channel.values = await Promise.all(channel.packed.map(unpack));
        return channels;
    }

    // ---- Values and colours ----

    const depthOf = (channels) => channels.find((c) => c.is_depth)?.values[0];
    const isSeen = (depth, i) => depth === undefined || Number.isFinite(depth[i]);
    // Numbers that stand for words are known of every pixel, also of one without a return.
    const isKnown = (channel, depth, i) => channel.words || isSeen(depth, i);

    function quantile(values, seen, part) {
        const step = Math.max(1, Math.floor(values.length / 50000));
        const sample = [];
        for (let i = 0; i < values.length; i += step) if (seen(i) && Number.isFinite(values[i])) sample.push(values[i]);
        sample.sort((a, b) => a - b);
        return sample.length ? sample[Math.floor((sample.length - 1) * part)] : 0;
    }

    // The part of a range's colours that is left out at either end, so that an outlier does not flatten the rest.
    function scaleOf(channel, depth) {
        const values = channel.values[0], seen = (i) => isSeen(depth, i);
        const positive = channel.scale === "log";
        let low = quantile(values, seen, positive ? 0.01 : 0), high = quantile(values, seen, positive ? 0.99 : 1);
        if (channel.key === "intensity") [low, high] = [0, high / (values instanceof Uint16Array ? 65535 : 1)];
        if (positive) low = Math.max(low, 1e-3);
        return { low, high: Math.max(high, low) };
    }

    function idColour(id) {
        // Steps of the golden angle keep neighbouring ids apart; lightness tells ids of alike hue apart.
        const hue = (id * 137.508) % 360, light = 0.45 + 0.1 * ((id * 7) % 4);
        const part = (n) => {
            const k = (n + hue / 30) % 12;
            return Math.round(255 * (light - 0.75 * Math.min(light, 1 - light) * Math.max(-1, Math.min(k - 3, 9 - k, 1))));
        };
        return [part(0), part(8), part(4)];
    }

    const valueOf = (channel, i) => channel.key === "intensity" && channel.values[0] instanceof Uint16Array ? channel.values[0][i] / 65535 : channel.values[0][i];

    function colourer(channel, scale) {
        if (channel.scale === "id") {
            const known = new Map();
            return (i) => {
                const id = channel.values[0][i];
                if (!known.has(id)) known.set(id, idColour(id));
                return known.get(id);
            };
        }
        if (channel.scale === "normal") return (i) => channel.values.map((axis) => 128 + axis[i]);
        const { low, high } = scale;
        const at = channel.scale === "log" ? (v) => Math.log(v / low) / Math.log(high / low) : (v) => (v - low) / (high - low);
        return (i) => {
            const t = high > low ? at(valueOf(channel, i)) : 0.5;
            const index = 3 * Math.round(255 * Math.min(1, Math.max(0, Number.isNaN(t) ? 0 : t)));
            return [turbo[index], turbo[index + 1], turbo[index + 2]];
        };
    }

    // An id with what it stands for.
    function named(channel, id, view) {
        if (channel.words?.[id]) return channel.words[id].replaceAll("_", " ");
        const name = { "id.instance": view.instances, "id.semantic": view.labels }[channel.key]?.[id];
        return name === undefined ? String(id) : id + " “\u2068" + name + "\u2069”";
    }

    function decimals(unit) { return unit === "m" ? 4 : 6; }

    function shown(channel, i, view) {
        if (channel.scale === "normal") return "(" + channel.values.map((axis) => (axis[i] / 127).toFixed(2)).join(", ") + ")";
        const value = valueOf(channel, i);
        if (channel.scale === "id") {
            return named(channel, value, view);
        }
        return Number(value).toFixed(decimals(channel.unit)) + (channel.unit ? " " + channel.unit : "");
    }

    // How a pixel of the run differs from the baseline's: [colour, words].
    function differ(view, key) {
        view.differences ??= new Map();
        if (!view.differences.has(key)) view.differences.set(key, findDifference(view, key));
        return view.differences.get(key);
    }

    function findDifference(view, key) {
        const run = view.channels.find((c) => c.key === key), before = view.baseline.find((c) => c.key === key);
        if (!run || !before) return undefined;
        const [was, is] = [depthOf(view.baseline), depthOf(view.channels)];
        const exact = run.scale === "id", normal = run.scale === "normal";
        const tolerance = before.resolution / 2;
        const delta = (i) => normal
            ? Math.hypot(...run.values.map((axis, k) => (axis[i] - before.values[k][i]) / 127))
            : valueOf(run, i) - valueOf(before, i);
        const count = run.values[0].length;
        let largest = 0;
        for (let i = 0; i < count; i++) {
            if (isSeen(was, i) && isSeen(is, i)) {
                const d = Math.abs(delta(i));
                if (d > tolerance && d < Infinity) largest = Math.max(largest, d);
            }
        }
        // The end of the scale, which a few outliers may exceed, and the colour of a difference on it.
        const scale = before.difference_scale;
        const colour = (d) => {
            const t = 0.25 + 0.75 * (scale > 0 ? Math.min(1, Math.abs(d) / scale) : 1), to = d < 0 ? LESS : MORE;
            return SAME.map((c, k) => Math.round(c + (to[k] - c) * t));
        };
        const of = (i) => {
            const [a, b] = [isKnown(before, was, i), isKnown(run, is, i)];
            if (!a && !b) return [NOTHING, "no return in either"];
            if (!a) return [NEW, "appeared"];
            if (!b) return [GONE, "vanished"];
            const d = delta(i);
            if (exact) return d === 0 ? [SAME, "the same"] : [MORE, "another"];
            if (Math.abs(d) <= tolerance) return [SAME, "the same"];
            return [colour(d), (d > 0 ? "+" : "") + d.toFixed(decimals(run.unit)) + (run.unit ? " " + run.unit : "")];
        };
        return { of, largest, exact, normal, scale, colour, unit: run.unit };
    }

