// Sections of the page: frames, rigs and maps of the ground. Nothing is fetched: each section holds its data, deflated, and is
// unpacked when it comes near the window.
    // ---- A frame's section ----

    // What a section holds, read once. The points of its cloud are unpacked when they are asked for.
    const held = new WeakMap();
    function dataOf(section) {
        if (!held.has(section)) held.set(section, JSON.parse(section.querySelector("script").textContent));
        return held.get(section);
    }

    function pointsOf(section) {
        const data = dataOf(section);
        data.unpacked ??= (async () => {
            for (const axis of data.points) axis.values = await unpack(axis.packed);
            return data.points;
        })();
        return data.unpacked;
    }

    function withoutWebGl(section) {
        section.querySelector("canvas.cloud").hidden = true;
        section.querySelector(".cloud-hint").hidden = true;
        section.querySelector(".no-webgl").hidden = false;
    }

    const swatch = (colour, text) => {
        const span = element("span", "");
        const box = element("i", "", { class: "swatch" });
        box.style.background = "rgb(" + colour.join(",") + ")";
        span.append(box, element("bdi", text));
        return span;
    };

    // A bar of colours with numbers below it.
    function ramp(name, numbers, colour) {
        const whole = element("span", "", { class: "ramp", role: "img", "aria-label": name + ": colours from " + numbers[0] + " to " + numbers.at(-1) });
        const scale = element("span", name, { class: "scale" });
        const bar = element("canvas", "", { width: 256, height: 1 });
        const context = bar.getContext("2d"), image = context.createImageData(256, 1);
        for (let i = 0; i < 256; i++) image.data.set([...colour(i / 255), 255], 4 * i);
        context.putImageData(image, 0, 0);
        const below = element("span", "", { class: "numbers" });
        numbers.forEach((number, n) => {
            const place = element("span", number);
            place.style.left = 100 * (numbers.length > 1 ? n / (numbers.length - 1) : 0.5) + "%";
            below.append(place);
        });
        whole.append(bar, below);
        scale.append(whole);
        return scale;
    }
    const tableColour = (table) => (t) => table.slice(3 * Math.round(255 * t), 3 * Math.round(255 * t) + 3);
    const short = (v) => String(Number(v.toPrecision(3))).replace("-", "\u2212");

    async function show(section) {
        const view = dataOf(section);
        await unpackChannels(view.channels);
        await unpackChannels(view.baseline);
        const { rows, columns } = view;
        // A page has fewer pixels of a frame that is too large. People are told its own rows and columns, and links name them.
        const [rowStep, columnStep] = view.steps;
        const depth = depthOf(view.channels);
        const controls = section.querySelector(".controls"), legend = section.querySelector(".legend");

        const choice = element("select", "");
        for (const channel of view.channels) choice.append(element("option", channel.label, { value: channel.key }));
        const label = element("label", "Show ");
        label.append(choice);
        controls.append(label);
        let differences;
        if (view.baseline && view.points) {
            differences = element("input", "", { type: "checkbox" });
            const label = element("label", "");
            label.append(differences, " cloud coloured by difference");
            controls.append(label);
        }

        // Every picture, with what colours its pixels.
        const pictures = [...section.querySelectorAll("canvas[data-picture]")];
        for (const canvas of pictures) {
            [canvas.width, canvas.height] = [columns, rows];
            canvas.style.aspectRatio = columns + " / " + rows * view.stretch;
        }
        const channelsOf = (picture) => (picture === "baseline" ? view.baseline : view.channels);
        const fill = (canvas, seen, colour) => {
            const context = canvas.getContext("2d");
            const image = context.createImageData(columns, rows);
            for (let i = 0; i < rows * columns; i++) {
                const [r, g, b] = seen(i) ? colour(i) : NOTHING;
                image.data.set([r, g, b, 255], 4 * i);
            }
            context.putImageData(image, 0, 0);
        };

        let cloud = null, pixels = [];
        const canvas = section.querySelector("canvas.cloud");
        if (canvas) {
            cloud = cloudOf(canvas, [{ axes: await pointsOf(section) }]);
            // The pixels with a return, in order, are the points.
            if (!cloud) withoutWebGl(section);
            for (let i = 0; cloud && i < rows * columns; i++) if (isSeen(depth, i)) pixels.push(i);
        }

        const tell = (channel, scale) => {
            legend.replaceChildren();
            if (channel.scale === "normal") {
                legend.append("red, green and blue: the normal's x, y and z, from −1 (dark) to 1 (bright)");
            } else if (channel.scale === "id") {
                const counts = new Map();
                for (let i = 0; i < rows * columns; i++) if (isKnown(channel, depth, i)) counts.set(channel.values[0][i], (counts.get(channel.values[0][i]) ?? 0) + 1);
                const most = [...counts].sort((a, b) => b[1] - a[1] || a[0] - b[0]);
                for (const [id, count] of most.slice(0, 12)) {
                    legend.append(swatch(idColour(id), named(channel, id, view) + ": " + count + (channel.words ? " pixel" : " point") + (count === 1 ? "" : "s")));
                }
                if (most.length > 12) legend.append(most.length - 12 + " more");
            } else {
                const log = channel.scale === "log";
                const at = (t) => (log ? scale.low * (scale.high / scale.low) ** t : scale.low + (scale.high - scale.low) * t);
                const name = channel.label + (channel.unit ? ", " + channel.unit : "");
                const numbers = scale.high > scale.low ? [0, 1 / 3, 2 / 3, 1].map((t) => short(at(t))) : [short(scale.low)];
                legend.append(ramp(name + (log ? " (logarithmic)" : ""), numbers, tableColour(turbo)));
            }
            if (depth && pictures.length && !channel.words) legend.append(swatch(NOTHING, "no return"));
            const difference = view.baseline && differ(view, channel.key);
            if (difference) {
                const { scale, largest, unit } = difference;
                if (difference.exact) legend.append("difference:", swatch(MORE, "another"));
                else if (scale > 0) {
                    const more = largest > scale ? "\u2265\u2009" : "", less = largest > scale ? "\u2264\u2009" : "";
                    const name = (difference.normal ? "difference, turned by" : "difference") + (unit ? ", " + unit : "");
                    legend.append(difference.normal
                        ? ramp(name, ["0", short(scale / 2), more + short(scale)], (t) => (t ? difference.colour(t * scale) : SAME))
                        : ramp(name, [less + short(-scale), "0", more + short(scale)],
                            (t) => (Math.abs(t - 0.5) < 0.002 ? SAME : difference.colour((2 * t - 1) * scale))));
                    if (largest > scale) legend.append("up to " + short(largest) + (unit ? " " + unit : ""));
                }
                legend.append(swatch(SAME, "the same"));
                legend.append(swatch(NEW, "appeared"), swatch(GONE, "vanished"));
            }
        };

        const paint = () => {
            const key = choice.value;
            const channel = view.channels.find((c) => c.key === key);
            const scale = scaleOf(channel, depth);
            const difference = view.baseline && differ(view, key);
            for (const canvas of pictures) {
                const picture = canvas.dataset.picture;
                canvas.parentElement.classList.toggle("missing", picture !== "run" && !difference);
                if (picture === "difference") {
                    fill(canvas, () => difference, (i) => difference.of(i)[0]);
                } else {
                    const channels = channelsOf(picture);
                    const own = channels.find((c) => c.key === key), seen = depthOf(channels);
                    if (own) fill(canvas, (i) => isKnown(own, seen, i), colourer(own, scale));
                    else fill(canvas, () => false);
                }
            }
            if (cloud) {
                const byDifference = differences?.checked && difference;
                const colour = byDifference ? (i) => difference.of(i)[0] : colourer(channel, scale);
                cloud.paint(0, (point) => colour(pixels[point] ?? 0));
            }
            tell(channel, scale);
        };

        const output = section.querySelector(".values");
        let place = null;
        const inspect = (row, column) => {
            place = [row, column];
            const i = row * columns + column;
            const where = "row " + row * rowStep + ", column " + column * columnStep;
            output.replaceChildren();
            for (const canvas of pictures) {
                const picture = canvas.dataset.picture;
                const line = element("p", "");
                if (picture === "difference") {
                    const difference = differ(view, choice.value);
                    line.append("difference: ", difference ? difference.of(i)[1] : "the baseline has no pixels of this channel");
                } else {
                    const channels = channelsOf(picture), seen = depthOf(channels);
                    line.append(pictures.length > 1 ? picture + ": " : where + ": ");
                    const cause = channels.find((c) => c.key === "cause");
                    if (!isSeen(seen, i)) line.append("no return", cause ? ": " + shown(cause, i, view) : "");
                    else channels.forEach((c, n) => line.append(n ? ", " : "", element("b", c.label + " "), shown(c, i, view)));
                }
                output.append(line);
                const marker = canvas.parentElement.querySelector(".marker");
                marker.hidden = false;
                marker.style.left = 100 * (column + 0.5) / columns + "%";
                marker.style.top = 100 * (row + 0.5) / rows + "%";
            }
            if (pictures.length > 1) output.prepend(element("p", where));
        };
        for (const canvas of pictures) {
            canvas.addEventListener("pointermove", (event) => {
                const box = canvas.getBoundingClientRect();
                const part = (at, from, size, n) => Math.min(n - 1, Math.max(0, Math.floor(n * (at - from) / size)));
                inspect(part(event.clientY, box.top, box.height, rows), part(event.clientX, box.left, box.width, columns));
            });
            canvas.addEventListener("keydown", (event) => {
                const by = event.shiftKey ? 10 : 1;
                const step = { ArrowLeft: [0, -by], ArrowRight: [0, by], ArrowUp: [-by, 0], ArrowDown: [by, 0] }[event.key];
                if (!step || event.ctrlKey || event.altKey || event.metaKey) return;
                event.preventDefault();
                const [row, column] = place ?? [Math.floor(rows / 2), Math.floor(columns / 2)];
                const within = (v, n) => Math.min(n - 1, Math.max(0, v));
                inspect(within(row + step[0], rows), within(column + step[1], columns));
            });
        }
        choice.addEventListener("change", () => {
            paint();
            if (place) inspect(...place);
        });
        differences?.addEventListener("change", paint);
        paint();
        section.setAttribute("aria-busy", "false");
        // Shows a channel and a pixel, as a link asks for.
        return (key, pixel) => {
            if (view.channels.some((c) => c.key === key) && choice.value !== key) {
                choice.value = key;
                paint();
            }
            if (pixel && pictures.length) inspect(Math.floor(pixel[0] / rowStep), Math.floor(pixel[1] / columnStep));
        };
    }

    // ---- A rig's section: all clouds in the vehicle's frame ----

    const SENSORS = [[0x4c, 0x9b, 0xff], [0xff, 0x8c, 0x2e], [0x2f, 0xe0, 0xd8], [0xff, 0x4f, 0xd0], [0xb5, 0xe8, 0x53], [0xff, 0xd7, 0x4a], [0xb4, 0x94, 0xff], [0xff, 0x7a, 0x7a]];
    const sensorColour = (n) => SENSORS[n] ?? idColour(n);

    async function showRig(section) {
        const rig = dataOf(section);
        const parts = [], shapes = [];
        for (const { section: id, mount } of rig.sensors) {
            const own = document.getElementById(id);
            if (own && dataOf(own).points) parts.push({ axes: await pointsOf(own), mount: new Float32Array(mount) });
            else parts.push({ axes: [0, 1, 2].map(() => ({ low: 0, step: 1, values: [] })) });
        }
        const filled = (points, colour) => {
            const colours = new Uint8Array(points.length / 3 * 4);
            for (let i = 0; i < points.length / 3; i++) colours.set([...colour(i), 255], 4 * i);
            return colours;
        };
        rig.sensors.forEach(({ mount, edges }, n) => {
            const points = floatsOf(edges);
            shapes.push({ points, colours: filled(points, () => sensorColour(n)), lines: true, mount: new Float32Array(mount) });
        });
        if (rig.vehicle) {
            const points = floatsOf(rig.vehicle);
            // Light from above and the left; either side of a triangle is bright.
            const shade = (i) => {
                const at = 9 * Math.floor(i / 3), p = (k) => [0, 1, 2].map((axis) => points[at + 3 * k + axis] - points[at + axis]);
                const [a, b] = [p(1), p(2)];
                const n = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
                const light = Math.abs(0.3 * n[0] + 0.5 * n[1] + 0.8 * n[2]) / (Math.hypot(...n) || 1);
                return [0, 0, 0].map(() => 70 + 140 * Math.min(1, light));
            };
            shapes.push({ points, colours: filled(points, shade) });
        }
        const cloud = cloudOf(section.querySelector("canvas.cloud"), parts, shapes);
        const controls = section.querySelector(".controls"), legend = section.querySelector(".legend");
        if (cloud) {
            const [low, high] = [cloud.height(0.01), cloud.height(0.99)];
            const choice = element("select", "");
            choice.append(element("option", "sensor", { value: "sensor" }), element("option", "height", { value: "height" }));
            const label = element("label", "Colour by ");
            label.append(choice);
            controls.append(label);
            const paint = () => {
                legend.replaceChildren();
                const byHeight = choice.value === "height";
                const colour = tableColour(turbo);
                const part = (z) => Math.min(1, Math.max(0, high > low ? (z - low) / (high - low) : 0.5));
                rig.sensors.forEach((_, n) => cloud.paint(n, (i, at) => (byHeight ? colour(1 - part(at(i, 2))) : sensorColour(n))));
                if (byHeight) legend.append(ramp("height, m", [low, (low + high) / 2, high].map(short), (t) => colour(1 - t)));
                rig.sensors.forEach(({ name }, n) => legend.append(swatch(sensorColour(n), name)));
                if (rig.vehicle) legend.append(swatch([0xb0, 0xb0, 0xb0], "vehicle"));
            };
            const toggle = (text, change) => {
                const box = element("input", "", { type: "checkbox" }), label = element("label", "");
                box.checked = true;
                label.append(box, element("bdi", " " + text));
                controls.append(label);
                box.addEventListener("change", () => change(!box.checked));
            };
            rig.sensors.forEach(({ name }, n) => toggle(name, (hidden) => {
                shapes[n].away = hidden;
                shapes[n].hidden = hidden || shapes[n].edgeless;
                cloud.hide(n, hidden);
            }));
            toggle("fields of view", (hidden) => {
                for (const shape of shapes.slice(0, rig.sensors.length)) {
                    shape.edgeless = hidden;
                    shape.hidden = hidden || shape.away;
                }
                cloud.redraw();
            });
            choice.addEventListener("change", paint);
            paint();
        } else withoutWebGl(section);
        section.setAttribute("aria-busy", "false");
        return () => {};
    }

    // ---- A map of the ground ----

    async function showGround(section) {
        const { rows, columns, most, place, counts } = dataOf(section);
        const values = await unpack(counts);
        const canvas = section.querySelector("canvas");
        [canvas.width, canvas.height] = [columns, rows];
        ["left", "top", "width", "height"].forEach((side, k) => { canvas.style[side] = place[k] + "%"; });
        const colour = tableColour(viridis), context = canvas.getContext("2d"), image = context.createImageData(columns, rows);
        // +x is up and +y is left; x varies fastest.
        for (let down = 0; down < rows; down++) {
            for (let across = 0; across < columns; across++) {
                const count = values[(columns - 1 - across) * rows + rows - 1 - down];
                const shade = count === 0 ? UNSEEN : colour(most > 1 ? Math.log(count) / Math.log(most) : 1);
                image.data.set([...shade, 255], 4 * (down * columns + across));
            }
        }
        context.putImageData(image, 0, 0);
        const middle = Math.round(Math.sqrt(most));
        const numbers = [...new Set([1, middle, most])].map(String);
        section.querySelector(".legend").prepend(ramp("returns a cell (logarithmic)", numbers, colour), swatch(UNSEEN, "ground not seen"));
        section.setAttribute("aria-busy", "false");
        return () => {};
    }

    // ---- The page ----

    document.getElementById("theme").addEventListener("change", (event) => {
        document.documentElement.dataset.theme = event.target.value;
    });
    const fail = (section, why) => {
        section.setAttribute("aria-busy", "false");
        section.append(element("p", "This can't be shown: " + why, { role: "alert" }));
        return () => {};
    };
    const shows = { view: show, rig: showRig, ground: showGround };
    const showing = new Map();
    // Shows a section, once. The promise gives what looks at one of its channels and pixels.
    const appear = (section) => {
        if (!showing.has(section)) {
            const [kind] = Object.keys(shows).filter((kind) => section.classList.contains(kind));
            showing.set(section, typeof DecompressionStream === "undefined"
                ? Promise.resolve(fail(section, "this browser can't unpack its data; those of 2023 and later can."))
                : shows[kind](section).catch((error) => fail(section, error.message)));
        }
        return showing.get(section);
    };
    const sight = new IntersectionObserver((entries) => {
        for (const { isIntersecting, target } of entries) {
            if (!isIntersecting) continue;
            sight.unobserve(target);
            appear(target);
        }
    }, { rootMargin: "300px" });
    document.documentElement.classList.add("scripted");
    for (const section of document.querySelectorAll("section[aria-busy]")) sight.observe(section);
    for (const link of document.querySelectorAll("a[data-channel]")) {
        link.addEventListener("click", async () => {
            const section = document.getElementById(link.hash.slice(1));
            const { channel, pixel } = link.dataset;
            (await appear(section))(channel, pixel && pixel.split(",").map(Number));
        });
    }
})();
