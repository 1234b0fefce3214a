//! Files that begin with a signature of their own.

use super::kind::FileKind::{
    self, Calibration, Cloud, E57, Exr, Gltf, Gltf1, Las, Mcap, Mesh, Npy, Npz, Other, Pcd, Ply, Recording,
    Wrapped,
};
use super::kind::Unit;

const BLENDER: &str = "Blender imports it and exports glTF (File > Export > glTF 2.0)";
const ASSIMP: &str = "Blender, or `assimp export FILE scene.glb`, makes glTF of it";
const USD: &str = "Blender, or `usd2gltf -i FILE -o scene.glb`, makes glTF of it";

/// The first bytes of files, what they are, and where the bytes stand if that is not the beginning.
const SIGNATURES: &[(usize, &[u8], FileKind)] = &[
    (0, b"version https://git-lfs.github.com/spec/", LFS),
    (0, b"version https://hawser.github.com/spec/", LFS),
    (
        0,
        b"/annex/objects/",
        Wrapped("a git-annex pointer", "`git annex get FILE` fetches the file that it stands for"),
    ),
    (0, b"\x1f\x8b", Wrapped("compressed with gzip", "`gunzip` unpacks it")),
    (0, b"\x28\xb5\x2f\xfd", Wrapped("compressed with zstd", "`unzstd` unpacks it")),
    (0, b"\xfd7zXZ\0", Wrapped("compressed with xz", "`unxz` unpacks it")),
    (0, b"BZh", Wrapped("compressed with bzip2", "`bunzip2` unpacks it")),
    (0, b"\x04\x22\x4d\x18", Wrapped("compressed with lz4", "`unlz4` unpacks it")),
    (0, b"7z\xbc\xaf\x27\x1c", Wrapped("a 7z archive", "`7z x FILE` unpacks it")),
    (0, b"Rar!\x1a\x07", Wrapped("a RAR archive", "`unrar x FILE` unpacks it")),
    (257, b"ustar", Wrapped("a tar archive", "`tar xf FILE` unpacks it")),
    (
        0,
        b"b3dm",
        Wrapped(
            "a tile of 3D Tiles (b3dm)",
            "`3d-tiles-tools b3dmToGlb -i FILE -o scene.glb` takes the glTF out of it",
        ),
    ),
    (
        0,
        b"i3dm",
        Wrapped(
            "a tile of 3D Tiles (i3dm)",
            "`3d-tiles-tools i3dmToGlb -i FILE -o scene.glb` takes the glTF out of it",
        ),
    ),
    (
        0,
        b"cmpt",
        Wrapped(
            "a tile of 3D Tiles (cmpt)",
            "`3d-tiles-tools cmptToGlb -i FILE -o scene.glb` takes the glTF out of it",
        ),
    ),
    (0, b"pnts", Cloud("a tile of 3D Tiles (pnts)")),
    (0, b"PXR-USDC", Mesh("a USD file (usdc)", USD)),
    (0, b"#usda", Mesh("a USD file (usda)", USD)),
    (0, b"Kaydara FBX Binary", Mesh("an FBX file", FBX)),
    (0, b"; FBX ", Mesh("an FBX file", FBX)),
    (
        0,
        b"BLENDER",
        Mesh("a Blender file", "open it in Blender and export it as glTF (File > Export > glTF 2.0)"),
    ),
    (0, b"xof 0", Mesh("a DirectX mesh", ASSIMP)),
    (0, b"#VRML", Mesh("a VRML scene", BLENDER)),
    (0, b"#X3D", Mesh("an X3D scene", BLENDER)),
    (
        0,
        b"DRACO",
        Mesh(
            "a Draco mesh",
            "`draco_decoder -i FILE -o mesh.obj`, then Blender or obj2gltf, make glTF of it",
        ),
    ),
    (0, b"ISO-10303-21", Mesh("a STEP or IFC file", "FreeCAD or IfcConvert makes glTF of it")),
    (0, b"glTF\x01\0\0\0", Gltf1),
    (0, b"glTF", Gltf),
    (0, b"\x76\x2f\x31\x01", Exr),
    (0, b"ply\n", Ply),
    (0, b"ply\r", Ply),
    (0, b"LASF", Las),
    (0, b"ASTM-E57", E57),
    (0, b"# .PCD", Pcd),
    (0, b"VERSION 0.7\nFIELDS ", Pcd),
    (0, b"VERSION .7\nFIELDS ", Pcd),
    (0, b"\xd4\xc3\xb2\xa1", PCAP),
    (0, b"\xa1\xb2\xc3\xd4", PCAP),
    (0, b"\x4d\x3c\xb2\xa1", PCAP),
    (0, b"\xa1\xb2\x3c\x4d", PCAP),
    (0, b"\x0a\x0d\x0d\x0a", PCAP),
    (0, b"\xee\xff\x01", Calibration(Unit::HesaiMirrors)),
    (0, b"#ROSBAG", Recording("a ROS bag")),
    (0, b"\x89MCAP", Mcap),
    (0, b"SQLite format 3", Recording("an SQLite database, perhaps a ROS 2 bag")),
    (0, b"\x89PNG\r\n\x1a\n", Other("a PNG image")),
    (0, b"\xff\xd8\xff", Other("a JPEG image")),
    (0, b"II*\0", Other("a TIFF image")),
    (0, b"MM\0*", Other("a TIFF image")),
    (0, b"DDS ", Other("a DDS texture")),
    (0, b"\xabKTX ", Other("a KTX texture")),
    (0, b"#?RADIANCE", Other("an HDR image")),
    (8, b"WEBP", Other("a WebP image")),
    (0, b"%PDF", Other("a PDF")),
    (0, b"\x93NUMPY", Npy),
    (0, b"\x89HDF\r\n\x1a\n", Other("an HDF5 file")),
    (0, b"\x7fELF", Other("a program")),
];

const LFS: FileKind = Wrapped("a Git LFS pointer", "`git lfs pull` fetches the file that it stands for");
const FBX: &str = "Blender, or FBX2glTF, makes glTF of it";
const PCAP: FileKind = Recording("a packet capture (pcap)");

/// The kind of a file by its first bytes, if they are a signature.
pub(super) fn kind_of(head: &[u8], length: u64) -> Option<FileKind> {
    if head.starts_with(b"PK\x03\x04") || head.starts_with(b"PK\x05\x06") {
        return Some(kind_of_zip(head));
    }
    let found =
        SIGNATURES.iter().find(|(at, bytes, _)| head.get(*at..).is_some_and(|rest| rest.starts_with(bytes)));
    found
        .map(|(.., kind)| kind.clone())
        .or_else(|| is_binary_stl(head, length).then_some(Mesh("an STL mesh", ASSIMP)))
}

/// A zip by the name of its first entry: several formats are zips.
fn kind_of_zip(head: &[u8]) -> FileKind {
    let u16_at = |at: usize| {
        head.get(at..at + 2).map_or(0, |bytes| usize::from(bytes[0]) | usize::from(bytes[1]) << 8)
    };
    let name = head.get(30..30 + u16_at(26)).unwrap_or_default();
    match () {
        () if name.ends_with(b".npy") => Npz,
        () if name.ends_with(b".usdc") || name.ends_with(b".usda") || name.ends_with(b".usd") => {
            Mesh("a USD file (usdz)", USD)
        }
        () if name.starts_with(b"3D/") => Mesh("a 3MF mesh", ASSIMP),
        () if name == b"doc.kml" => Mesh("a KMZ file", BLENDER),
        () => Wrapped("a zip archive", "`unzip FILE` unpacks it"),
    }
}

/// A binary STL has no signature, but a length that follows from its number of triangles: 84 bytes, and 50 for each.
fn is_binary_stl(head: &[u8], length: u64) -> bool {
    let count = head.get(80..84).map(|bytes| u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]));
    count.is_some_and(|count| count > 0 && length == 84 + 50 * u64::from(count))
}
