//! Compressed primitives, and files that ask for more than they hold.

use super::*;

/// A cube from (0, 0, 0) to (1, 1, 1) as streams of Draco: 8 vertices and 12 triangles, with POSITION (attribute 0), JOINTS (1:
/// bytes, 0 below and 1 above) and WEIGHTS (2: bytes, of which 255 stands for 1). They were made by draco-core's encoder, in
/// sequence and by EdgeBreaker.
const SEQUENTIAL: &str = "445241434f0202010000000c0801000201010203040503060507000104040105020603030607000402020406010305050307\
    01030009030000040204000104020401020001010000000000000000000000000000803f0000000000000000000000000000803f000000000000803f\
    0000803f0000000000000000000000000000803f0000803f000000000000803f000000000000803f0000803f0000803f0000803f0000803f00010101\
    0102013e0102038066940000000001000000000101010102013e01020380af9300000000ff000000";
const EDGEBREAKER: &str = "445241434f02020101000000080c020b010003af3e0a010110ff023541ff02354103ff000000000001000001000903000000\
    01040204000101010402040102010000803f0000803f0000803f0000803f0000803f00000000000000000000803f0000803f000000000000803f0000\
    00000000803f00000000000000000000803f000000000000803f00000000000000000000803f000000000000000000000000010101000203014001001\
    10110000000000001000000010101010102013e01020380af9300000000ff000000";

fn bytes(hex: &str) -> Vec<u8> {
    (0..hex.len()).step_by(2).map(|at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap()).collect()
}

/// A file whose only primitive is a stream of Draco.
fn compressed(stream: &[u8]) -> Asset {
    let mut asset = Asset::new();
    let view = asset.view(stream);
    for (kind, component, count) in
        [("VEC3", FLOAT, 8), ("SCALAR", USHORT, 36), ("VEC4", UBYTE, 8), ("VEC4", UBYTE, 8)]
    {
        asset.push("accessors", json!({ "componentType": component, "count": count, "type": kind }));
    }
    asset.json["accessors"][3]["normalized"] = json!(true);
    let mesh = asset.mesh(json!({
        "attributes": { "POSITION": 0, "JOINTS_0": 2, "WEIGHTS_0": 3 },
        "indices": 1,
        "extensions": { "KHR_draco_mesh_compression": {
            "bufferView": view, "attributes": { "POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2 },
        } },
    }));
    asset.push("nodes", json!({ "name": "cube", "mesh": mesh }));
    asset
}

/// The volume within closed triangles that face outwards.
fn volume(loaded: &Loaded) -> f64 {
    world(loaded).iter().map(|[a, b, c]| a.cross(*b).dot(*c) / 6.0).sum()
}

#[test]
fn draco_is_decoded_whether_it_is_required_or_only_used() {
    // The case draco_used_not_required.
    for stream in [SEQUENTIAL, EDGEBREAKER] {
        let mut asset = compressed(&bytes(stream));
        for list in ["extensions", "extensionsUsed", "extensionsRequired"] {
            if list != "extensions" {
                asset.json[list] = json!(["KHR_draco_mesh_compression"]);
            }
            let loaded = asset.load();
            assert_eq!(loaded.scene.triangle_count(), 12);
            assert!((volume(&loaded).abs() - 1.0).abs() < 1e-12, "{}", volume(&loaded));
            assert!(loaded.notices.is_empty(), "{:?}", told(&loaded));
        }
        // A skin takes its joints and weights from the stream: the upper half moves by 2.
        asset.json["skins"] = json!([{ "joints": [1, 2] }]);
        asset.json["nodes"] = json!([{ "mesh": 0, "skin": 0 }, {}, { "translation": [0, 0, 2] }]);
        assert!((volume(&asset.load()).abs() - 3.0).abs() < 1e-12);
    }
}

#[test]
fn draco_that_is_broken_names_the_primitive_and_a_way_out() {
    let stream = bytes(EDGEBREAKER);
    let mut asset = compressed(&stream);
    asset.json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]["attributes"]["POSITION"] =
        json!(9);
    let error = asset.error();
    assert!(error.starts_with("node 0 \"cube\", mesh 0, primitive 0, KHR_draco"), "{error}");
    assert!(error.contains("POSITION: the stream has no attribute 9"), "{error}");
    for length in 0..stream.len() {
        let loaded = compressed(&stream[..length]).load_with(&plain());
        let error = loaded.expect_err("a stream that is cut short").to_string();
        assert!(!error.contains("error in beamcast"), "{length}: {error}");
    }
    // No byte of a stream makes the decoder panic or allocate without end.
    for stream in [SEQUENTIAL, EDGEBREAKER].map(bytes) {
        for at in 0..stream.len() {
            for value in [0, 0x7f, 0xff] {
                let mut broken = stream.clone();
                broken[at] = value;
                let start = std::time::Instant::now();
                if let Err(error) = compressed(&broken).load_with(&plain()) {
                    assert!(!error.problem.contains("error in beamcast"), "byte {at} is {value}: {error}");
                }
                assert!(start.elapsed().as_secs() < 10, "byte {at} is {value}");
            }
        }
    }
}

/// A stream of meshopt's attribute codec, version 0: `count` elements of `stride` bytes, all zero.
fn zeros_of_meshopt(count: usize, stride: usize) -> Vec<u8> {
    let block = (8192 / stride).min(256) & !15;
    let mut stream = vec![0xa0];
    let mut left = count;
    while left > 0 {
        let elements = left.min(block);
        // Two bits for each group of sixteen say that all differences are zero.
        stream.extend(vec![0; stride * elements.div_ceil(16).div_ceil(4)]);
        left -= elements;
    }
    stream.extend(vec![0; stride.max(32)]);
    stream
}

#[test]
fn placements_that_are_stored_compressed_count_as_what_they_unpack_to() {
    // The case inst_grid_600000, whose 600 000 placements are 0.7 MB.
    let count = 600_000;
    let mut asset = Asset::triangle();
    let stream = zeros_of_meshopt(count, 12);
    let view = asset.view(&stream);
    let place = asset.json["bufferViews"][view]["byteOffset"].clone();
    asset.json["bufferViews"][view] = json!({
        "buffer": 1, "byteLength": count * 12, "byteStride": 12,
        "extensions": { "EXT_meshopt_compression": {
            "buffer": 0, "byteOffset": place, "byteLength": stream.len(), "byteStride": 12, "count": count,
            "mode": "ATTRIBUTES",
        } },
    });
    let places = asset.push(
        "accessors",
        json!({ "bufferView": view, "componentType": FLOAT, "count": count, "type": "VEC3" }),
    );
    asset.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] =
        json!({ "TRANSLATION": places });
    let mut json: Value = serde_json::from_str(&asset.text()).unwrap();
    json["buffers"].as_array_mut().unwrap().push(json!({ "byteLength": count * 12 }));
    let loaded = load_bytes(json.to_string().as_bytes(), &plain()).unwrap();
    assert_eq!(loaded.scene.geometry.objects.len(), count);
}

/// A file of one triangle whose vertices are `count` zeros that are not stored.
fn zeros(count: usize) -> Asset {
    let mut asset = Asset::triangle();
    let accessor = json!({ "componentType": FLOAT, "count": count, "type": "VEC3" });
    asset.json["accessors"][0] = accessor;
    asset.json["meshes"][0]["primitives"][0].as_object_mut().unwrap().remove("indices");
    asset
}

#[test]
fn work_that_a_file_multiplies_is_refused_before_it_is_done() {
    // The case gltf-morph-time: targets × vertices.
    let mut asset = zeros(6_000_000);
    asset.json["meshes"][0]["weights"] = json!(vec![1; 1000]);
    asset.json["meshes"][0]["primitives"][0]["targets"] = json!(vec![json!({ "POSITION": 0 }); 1000]);
    assert!(asset.error().contains("bytes of geometry, more than the"), "{}", asset.error());
    // Sets of joints × vertices.
    let mut asset = zeros(1_000_000);
    let joints =
        asset.push("accessors", json!({ "componentType": UBYTE, "count": 1_000_000, "type": "VEC4" }));
    let weights =
        asset.push("accessors", json!({ "componentType": FLOAT, "count": 1_000_000, "type": "VEC4" }));
    for set in 0..1000 {
        asset.json["meshes"][0]["primitives"][0]["attributes"][format!("JOINTS_{set}")] = json!(joints);
        asset.json["meshes"][0]["primitives"][0]["attributes"][format!("WEIGHTS_{set}")] = json!(weights);
    }
    asset.json["skins"] = json!([{ "joints": [0] }]);
    asset.json["nodes"][0]["skin"] = json!(0);
    assert!(asset.error().contains("bytes of geometry, more than the"), "{}", asset.error());
    // Targets that are stored are read, however many there are.
    let mut asset = Asset::triangle();
    let up = asset.floats("VEC3", &[[0.0, 0.0, 1.0]; 3]);
    asset.json["meshes"][0]["weights"] = json!(vec![0.5; 2000]);
    asset.json["meshes"][0]["primitives"][0]["targets"] = json!(vec![json!({ "POSITION": up }); 2000]);
    close(&world(&asset.load()), &[unit_at(0.0, 0.0, 1000.0)], 1e-9);
}

#[test]
fn a_file_that_many_buffers_name_is_read_once_and_counts_once() {
    // The case gltf-buffer-named-often.
    let folder = TempDir::new().unwrap();
    let asset = Asset::triangle();
    std::fs::write(folder.path().join("data.bin"), &asset.data).unwrap();
    let mut json = asset.json.clone();
    let names = ["data.bin", "./data.bin", "././data.bin", "d%61ta.bin"];
    // Each primitive has buffers, views and accessors of its own, which all lead to one file.
    let mut add = |list: &str, element: Value| {
        let list = json[list].as_array_mut().unwrap();
        list.push(element);
        list.len() - 1
    };
    let mut primitives = Vec::new();
    for number in 0..300 {
        let length = 36 + number % 7;
        let buffer = add("buffers", json!({ "uri": names[number % 4], "byteLength": length }));
        let view = add("bufferViews", json!({ "buffer": buffer, "byteLength": 36 }));
        let accessor = json!({ "bufferView": view, "componentType": FLOAT, "count": 3, "type": "VEC3" });
        let positions = add("accessors", accessor);
        primitives.push(json!({ "attributes": { "POSITION": positions } }));
    }
    json["meshes"] = json!([{ "primitives": primitives }]);
    let path = folder.path().join("scene.gltf");
    let load = |json: &Value| {
        std::fs::write(&path, json.to_string()).unwrap();
        load(&path, "scene.gltf", &plain())
    };
    let loaded = load(&json).unwrap();
    assert_eq!(loaded.scene.triangle_count(), 300);
    assert_eq!(loaded.scene.geometry.files.len(), 2, "{:?}", loaded.scene.geometry.files);
    // The file allows what it allows once: zeros that are not stored are refused, however many buffers name it.
    std::fs::write(folder.path().join("data.bin"), vec![0; 200_000]).unwrap();
    let count = 12_000_000;
    json["accessors"][0] = json!({ "componentType": FLOAT, "count": count, "type": "VEC3" });
    json["meshes"][0]["primitives"].as_array_mut().unwrap().push(json!({ "attributes": { "POSITION": 0 } }));
    for buffer in json["buffers"].as_array_mut().unwrap() {
        buffer["byteLength"] = json!(200_000);
    }
    let error = load(&json).unwrap_err();
    assert!(error.problem.contains("bytes of geometry, more than the"), "{error}");
}

#[test]
fn meshopt_with_a_fallback_buffer_that_is_not_there() {
    // The indices of 4 × 4 quads of 2 triangles each. The decoder's own tests say where the stream is from.
    let stream = "e1fe1e100e100e100ece1e160e150e140ece1e140e140e140ece1e140e140e140e0f0a007687566778a9866589689801690000";
    let stream: Vec<u8> =
        (0..stream.len()).step_by(2).map(|at| u8::from_str_radix(&stream[at..at + 2], 16).unwrap()).collect();
    for extension in ["EXT_meshopt_compression", "KHR_meshopt_compression"] {
        let mut asset = Asset::new();
        let grid: Vec<[f32; 3]> = (0..25).map(|i| [(i % 5) as f32, (i / 5) as f32, 0.0]).collect();
        let positions = asset.floats("VEC3", &grid);
        let indices = asset.accessor("SCALAR", USHORT, 96, &stream);
        let view = &mut asset.json["bufferViews"][indices];
        view["extensions"][extension] = json!({
            "buffer": 0, "byteOffset": view["byteOffset"], "byteLength": stream.len(), "byteStride": 2,
            "count": 96, "mode": "TRIANGLES",
        });
        view["buffer"] = json!(1);
        view["byteOffset"] = json!(0);
        view["byteLength"] = json!(192);
        let mesh = asset.mesh(json!({ "attributes": { "POSITION": positions }, "indices": indices }));
        asset.push("nodes", json!({ "mesh": mesh }));
        asset.json["extensionsRequired"] = json!([extension]);
        let mut buffers: Value = serde_json::from_str::<Value>(&asset.text()).unwrap()["buffers"].take();
        buffers
            .as_array_mut()
            .unwrap()
            .push(json!({ "byteLength": 192, "extensions": { extension: { "fallback": true } } }));
        asset.json["buffers"] = buffers;
        let triangles = world(&asset.load());
        assert_eq!(triangles.len(), 32);
        let area: f64 = triangles.iter().map(|[a, b, c]| (b - a).cross(c - a).z / 2.0).sum();
        assert_eq!(area, 16.0);

        let compressed = &mut asset.json["bufferViews"][indices]["extensions"][extension];
        compressed["count"] = json!(99);
        assert!(asset.error().contains("the meshopt compression is broken"), "{}", asset.error());
        asset.json["bufferViews"][indices]["extensions"][extension]["count"] = json!(9_000_000_000_u64);
        assert!(asset.error().contains("bufferView 1: the"), "{}", asset.error());
        asset.json["bufferViews"][indices]["extensions"][extension]["mode"] = json!("LINES");
        assert!(asset.error().contains("unknown variant `LINES`"), "{}", asset.error());
    }
}

#[test]
fn draco_is_left_alone_where_there_are_accessors_and_read_where_there_are_none() {
    let mut asset = Asset::triangle();
    asset.json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"] =
        json!({ "bufferView": 0, "attributes": { "POSITION": 0 } });
    for extensions in ["extensionsUsed", "extensionsRequired"] {
        asset.json[extensions] = json!(["KHR_draco_mesh_compression"]);
        close(&world(&asset.load()), &[UNIT], 0.0);
    }
    for accessor in 0..2 {
        let mut compressed = Asset { json: asset.json.clone(), data: asset.data.clone() };
        compressed.json["accessors"][accessor].as_object_mut().unwrap().remove("bufferView");
        let error = compressed.error();
        let expected =
            "node 0, mesh 0, primitive 0, KHR_draco_mesh_compression: the Draco compression is broken";
        assert!(error.starts_with(expected), "{error}");
        assert!(
            error.ends_with("(`npx @gltf-transform/cli copy in.glb out.glb` writes it uncompressed)"),
            "{error}"
        );
    }
}
