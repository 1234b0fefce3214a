// Sections of the page: frames, rigs and maps of the ground. Nothing is fetched: each section holds its data, deflated, and is
// unpacked when it comes near the window.
    // ---- A frame's section ----

    // What a section holds, read once. The points of its cloud are unpacked when they are asked for.
    const held = new WeakMap();
    function dataOf(section) {
        if (!held.has(section)) held.set(section, JSON.parse(section.querySelector("script").textContent));
        return held.get(section);
    }

    function pointsOf(data) {
        data.unpacked ??= (async () => {
            for (const axis of data.points) axis.values = await unpack(axis.packed);
            return data.points;
        })();
        return data.unpacked;
    }

    // ---- Sequences: the moment that all sections show ----

    const player = { moment: 0, moments: [], turns: new Set() };

    // The frames of a section of a sequence, of which a few are kept unpacked. Null for a section of one frame.
    const films = new WeakMap();
    function filmOf(section) {
        if (!films.has(section)) {
            const holder = section.querySelector(".frames");
            films.set(section, holder && makeFilm(holder.children, JSON.parse(section.querySelector(":scope > script").textContent).scales));
        }
        return films.get(section);
    }

    const MOST_KEPT = 12;
    function makeFilm(frames, scales) {
        const kept = new Map();
        const read = async (moment) => {
            // At a moment without a frame the sensor shows its last one, or else its first.
            const order = [...frames].map((_, i) => i).sort((a, b) => (a > moment) - (b > moment) || Math.abs(a - moment) - Math.abs(b - moment));
            let data = null;
            for (const at of order) if ((data = JSON.parse(frames[at].textContent))) break;
            await unpackChannels(data.channels);
            return data;
        };
        const frame = (moment) => {
            if (!kept.has(moment)) {
                kept.set(moment, read(moment));
                if (kept.size > MOST_KEPT) kept.delete(kept.keys().next().value);
            }
            return kept.get(moment);
        };
        return { frame, scales };
    }

    // A section's data at a moment, with its channels unpacked.
    async function frameOf(section, moment) {
        const film = filmOf(section);
        if (film) return film.frame(moment);
        const data = dataOf(section);
        data.ready ??= Promise.all([unpackChannels(data.channels), unpackChannels(data.baseline)]);
        await data.ready;
        return data;
    }

    // Has a section follow the player from now on.
    async function follow(turn, moment) {
        player.turns.add(turn);
        if (player.moment !== moment) await turn(player.moment);
    }

    function startPlayer(section) {
        const { moments } = dataOf(section);
        player.moments = moments;
        const button = section.querySelector(".play"), slider = section.querySelector(".moment");
        const speeds = section.querySelector(".speed"), where = section.querySelector(".where");
        for (const speed of [0.25, 0.5, 1, 2, 4]) speeds.append(element("option", speed + "×", { value: speed }));
        speeds.value = "1";
        const tell = (at) => {
            const { frame, start_s: time, pose, boxes } = moments[at];
            const parts = ["frame " + frame + " (" + (at + 1) + " of " + moments.length + ")"];
            if (time !== null) parts.push(time.toFixed(3) + " s");
            if (pose) parts.push(pose.words);
            if (boxes.length) parts.push(boxes.length + (boxes.length === 1 ? " box" : " boxes"));
            where.textContent = parts.join(", ");
            slider.value = at;
            slider.setAttribute("aria-valuetext", parts[0]);
        };
        // Of the moments that are asked for while one is being shown, the last counts.
        let wanted = 0, going = null;
        const catchUp = async () => {
            while (player.moment !== wanted) {
                player.moment = wanted;
                await Promise.all([...player.turns].map((turn) => turn(player.moment)));
            }
        };
        const goTo = (at) => {
            wanted = at;
            tell(at);
            // It has caught up at once if the moment is the one that is shown, and is then over only after this assignment.
            going ??= catchUp().finally(() => { going = null; });
            return going;
        };
        let isPlaying = false;
        const wait = (milliseconds) => new Promise((done) => setTimeout(() => requestAnimationFrame(done), milliseconds));
        const play = async () => {
            while (isPlaying) {
                const began = performance.now(), from = wanted, to = (wanted + 1) % moments.length;
                await goTo(to);
                const seconds = moments[to].start_s - moments[from].start_s;
                // The sequence pauses before it begins again, and frames without times go ten times a second.
                const gap = to <= from ? 0.6 : seconds > 0 ? seconds : 0.1;
                await wait(Math.max(0, 1000 * gap / Number(speeds.value) - (performance.now() - began)));
            }
        };
        const toggle = () => {
            isPlaying = !isPlaying && moments.length > 1;
            button.textContent = isPlaying ? "❚❚" : "▶";
            button.setAttribute("aria-label", isPlaying ? "Pause" : "Play");
            if (isPlaying) play();
        };
        const stop = () => { if (isPlaying) toggle(); };
        button.addEventListener("click", toggle);
        slider.addEventListener("input", () => {
            stop();
            goTo(Number(slider.value));
        });
        document.addEventListener("keydown", (event) => {
            if (event.ctrlKey || event.altKey || event.metaKey || event.target.closest("select, button, input[type=checkbox]")) return;
            const step = { ",": -1, ".": 1 }[event.key];
            if (event.key === " ") toggle();
            else if (step) {
                stop();
                goTo(Math.min(moments.length - 1, Math.max(0, wanted + step)));
            } else return;
            event.preventDefault();
        });
        tell(0);
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
        const film = filmOf(section);
        let moment = player.moment;
        let view = await frameOf(section, moment);
        const { rows, columns } = view;
        // A page has fewer pixels of a frame that is too large. People are told its own rows and columns, and links name them.
        const [rowStep, columnStep] = view.steps;
        let depth = depthOf(view.channels);
        // The colours of a sequence mean the same in all its frames.
        const scaleFor = (channel) => {
            const known = film?.scales[channel.key];
            if (!known) return scaleOf(channel, depth);
            const low = channel.key === "intensity" ? 0 : channel.scale === "log" ? Math.max(known[0], 1e-3) : known[0];
            return { low, high: Math.max(known[1], low) };
        };
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
            cloud = cloudOf(canvas, [{ axes: await pointsOf(view) }]);
            if (!cloud) withoutWebGl(section);
        }
        // The pixels with a return, in order, are the points.
        const number = () => {
            pixels = [];
            for (let i = 0; cloud && i < rows * columns; i++) if (isSeen(depth, i)) pixels.push(i);
        };
        number();

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
            const channel = view.channels.find((c) => c.key === key) ?? view.channels[0];
            const scale = scaleFor(channel);
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
        if (film) {
            await follow(async (to) => {
                const next = await film.frame(to);
                const axes = cloud && next.points && await pointsOf(next);
                // A frame of another size than the first is none of this section's.
                if (next.rows !== rows || next.columns !== columns) return;
                [view, depth] = [next, depthOf(next.channels)];
                if (axes) cloud.replace(0, { axes });
                number();
                paint();
                if (place) inspect(...place);
            }, moment);
        }
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
        // What stands still in the vehicle's frame moves with `base` if the world is what stands still.
        const poseAt = (at) => player.moments[at]?.pose?.matrix;
        const moves = poseAt(0) !== undefined;
        let base = null, moment = player.moment;
        const placed = (mount) => (base ? times(base, new Float32Array(mount)) : new Float32Array(mount));
        const partOf = async ({ section: id, mount }, at) => {
            const own = document.getElementById(id);
            const data = own && await frameOf(own, at);
            if (!data?.points) return { axes: [0, 1, 2].map(() => ({ low: 0, step: 1, values: [] })) };
            return { axes: await pointsOf(data), mount: placed(mount) };
        };
        for (const sensor of rig.sensors) parts.push(await partOf(sensor, moment));
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
            shapes.push({ points, colours: filled(points, shade), ofVehicle: true });
        }
        // The way of the body and the boxes of objects stand in the world.
        const way = shapes.length, boxes = way + 1;
        const boxesAt = (at) => {
            const shown = player.moments[at]?.boxes ?? [];
            const lines = shown.map(({ edges }) => floatsOf(edges));
            const points = new Float32Array(lines.reduce((sum, line) => sum + line.length, 0));
            const colours = new Uint8Array(points.length / 3 * 4);
            let from = 0;
            lines.forEach((line, n) => {
                points.set(line, from);
                colours.set(filled(line, () => idColour(shown[n].label)), from / 3 * 4);
                from += line.length;
            });
            return [points, colours];
        };
        if (moves) {
            const steps = player.moments.map((_, at) => poseAt(at)).filter(Boolean).map((m) => m.slice(12, 15));
            const points = new Float32Array(steps.slice(1).flatMap((to, n) => [...steps[n], ...to]));
            shapes.push({ points, colours: filled(points, () => [255, 255, 255]), lines: true });
            const [edges, colours] = boxesAt(moment);
            shapes.push({ points: edges, colours, lines: true });
        }
        // The inverse of a rigid motion.
        const inverse = (m) => {
            const turn = [0, 1, 2].map((row) => [0, 1, 2].map((column) => m[4 * row + column]));
            const back = turn.map((row) => -(row[0] * m[12] + row[1] * m[13] + row[2] * m[14]));
            return new Float32Array([...[0, 1, 2].flatMap((column) => [...turn.map((row) => row[column]), 0]), ...back, 1]);
        };
        const place = (at) => {
            const pose = poseAt(at);
            rig.sensors.forEach(({ mount }, n) => { shapes[n].mount = placed(mount); });
            for (const shape of shapes) if (shape.ofVehicle) shape.mount = base ?? undefined;
            if (moves && pose) for (const n of [way, boxes]) shapes[n].mount = base ? undefined : inverse(pose);
        };
        place(moment);
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
            if (moves) {
                if (player.moments.some((m) => m.boxes.length)) toggle("boxes", (hidden) => {
                    shapes[boxes].hidden = hidden;
                    cloud.redraw();
                });
                const view = element("select", "");
                view.append(element("option", "vehicle", { value: "vehicle" }), element("option", "world", { value: "world" }));
                const label = element("label", "Stand on the ");
                label.append(view);
                controls.append(label);
                const turn = async (to) => {
                    moment = to;
                    base = view.value === "world" && poseAt(to) ? new Float32Array(poseAt(to)) : null;
                    const now = await Promise.all(rig.sensors.map((sensor) => partOf(sensor, to)));
                    if (to !== moment) return;
                    now.forEach((part, n) => cloud.replace(n, part));
                    cloud.reshape(boxes, ...boxesAt(to));
                    place(to);
                    paint();
                };
                view.addEventListener("change", async () => {
                    await turn(player.moment);
                    const [x, y, z] = cloud.middle;
                    cloud.lookAt(base ? [0, 1, 2].map((k) => base[k] * x + base[4 + k] * y + base[8 + k] * z + base[12 + k]) : cloud.middle);
                });
                paint();
                await follow(turn, moment);
            } else if (player.moments.length) {
                const turn = async (to) => {
                    const now = await Promise.all(rig.sensors.map((sensor) => partOf(sensor, to)));
                    now.forEach((part, n) => cloud.replace(n, part));
                    paint();
                };
                paint();
                await follow(turn, moment);
            } else paint();
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
    const bar = document.getElementById("player");
    if (bar) startPlayer(bar);
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
