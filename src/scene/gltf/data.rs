//! The binary data of a glTF file: buffers, the views into them, and the accessors that give the bytes a meaning. Every
//! size that the file declares is compared with the bytes that exist before anything is allocated or read.

use std::borrow::Cow;
use std::cell::{Cell, OnceCell, RefCell};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::rc::Rc;

use serde::Deserialize;
use serde_json::value::RawValue;

use super::document::{Document, GEOMETRY};
use super::draco::Draco;
use super::fault::{Fault, missing, quoted};
use super::files::{Folders, Resolved};
use super::notices::Notices;
use super::schema::{self, Accessor, Component, Kind};
use super::{files, meshopt};
use crate::scene::geometry::SourceFile;

/// The buffers, views, accessors and images of a file. A buffer is loaded when it is first needed, so a missing file that
/// nothing uses does no harm.
pub(super) struct Data<'a> {
    document: &'a Document,
    /// The GLB's binary chunk.
    chunk: Option<&'a [u8]>,
    /// The folders that URIs lead to.
    folders: &'a Folders,
    buffers: Vec<OnceCell<Content<'a>>>,
    /// The decoded bytes of the views that are stored compressed.
    decoded: Vec<OnceCell<Vec<u8>>>,
    /// The decoded primitives of the views that hold some.
    primitives: Vec<OnceCell<Draco>>,
    /// The content of every file that was read, by its canonical path, as far as a buffer reaches into it.
    contents: RefCell<BTreeMap<PathBuf, Rc<Vec<u8>>>>,
    /// The longest of the buffers that name a URI.
    longest: BTreeMap<&'a str, u64>,
    files: RefCell<Vec<SourceFile>>,
    budget: Budget,
}

enum Content<'a> {
    Chunk(&'a [u8]),
    Own(Vec<u8>),
    /// The first bytes of a file.
    File(Rc<Vec<u8>>, usize),
}

impl Content<'_> {
    fn bytes(&self) -> &[u8] {
        match self {
            Self::Chunk(bytes) => bytes,
            Self::Own(bytes) => bytes,
            Self::File(bytes, length) => &bytes[..*length],
        }
    }
}

/// The memory that a file may expand to. A few bytes of JSON can ask for any number of copies of the same data, or for zeros
/// without any data. So the bytes that the loader expands are counted, and compared with the bytes that were read.
///
/// Bytes that were stored compressed count as what they unpack to, since that is what the same file would have without
/// compression; but no compressed byte stands for more than [`Self::UNPACKED`] others.
struct Budget {
    spent: Cell<u64>,
    read: Cell<u64>,
    unpacked: Cell<u64>,
    /// The bytes that images took so far: those of their files, and those of their texels.
    of_images: Cell<u64>,
}

impl Budget {
    /// The bytes that any file may expand to. While the scene is built, it is a second copy of them.
    const BASE: u64 = 96 << 20;
    /// The bytes that each byte read may expand to in addition. An index of one byte, which is the densest data in glTF, becomes
    /// a triangle of twelve bytes; the rest allows for parts that are used several times.
    const FACTOR: u64 = 64;
    /// The bytes that each unpacked byte may expand to in addition. A placement of twelve bytes becomes an instance and an
    /// object of two hundred.
    const UNPACKED_FACTOR: u64 = 20;
    /// The most unpacked bytes that a compressed one counts for.
    const UNPACKED: u64 = 64;
    /// The bytes that the images of any file may take, and those that they may take in addition for each byte read. Four bytes of
    /// a texel of a photograph take a tenth as many or more in a file, but drawings and masks are more dense.
    const BASE_OF_IMAGES: u64 = 256 << 20;
    const FACTOR_OF_IMAGES: u64 = 64;

    fn most(&self) -> u64 {
        let read = self.read.get().saturating_mul(Self::FACTOR);
        let unpacked = self.unpacked.get().saturating_mul(Self::UNPACKED_FACTOR);
        Self::BASE.saturating_add(read).saturating_add(unpacked)
    }
}

/// The bytes of a view into a buffer.
#[derive(Clone, Copy)]
struct View<'b> {
    bytes: &'b [u8],
    stride: Option<usize>,
}

/// The elements of an accessor, checked to lie within their data.
#[derive(Clone, Copy)]
pub(super) struct Elements<'b> {
    count: usize,
    component: Component,
    /// The integer that stands for 1, if the components are normalised.
    one: Option<f64>,
    /// `None` means zeros.
    base: Option<Strided<'b>>,
    sparse: Option<Sparse<'b>>,
}

#[derive(Clone, Copy)]
struct Strided<'b> {
    bytes: &'b [u8],
    stride: usize,
}

/// Elements that differ from the base, by strictly increasing index.
#[derive(Clone, Copy)]
struct Sparse<'b> {
    count: usize,
    index_type: Component,
    indices: &'b [u8],
    values: Strided<'b>,
}

/// The types that an accessor must have to serve a purpose.
pub(super) struct Layout {
    /// The purpose, such as `POSITION`.
    pub purpose: &'static str,
    /// Scalar, vector or matrix.
    pub kind: Kind,
    /// The component types, each with whether it is normalised.
    pub components: &'static [(Component, bool)],
}

/// EXT_meshopt_compression or KHR_meshopt_compression of a view.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Compressed {
    buffer: u32,
    #[serde(default)]
    byte_offset: u64,
    byte_length: u64,
    byte_stride: usize,
    count: usize,
    mode: meshopt::Mode,
    #[serde(default)]
    filter: meshopt::Filter,
}

impl<'a> Data<'a> {
    /// The data of a file that has `read` bytes.
    pub fn new(
        document: &'a Document,
        chunk: Option<&'a [u8]>,
        folders: &'a Folders,
        read: u64,
        notices: &Notices,
    ) -> Self {
        let mut longest = BTreeMap::new();
        for (index, buffer) in document.buffers.iter().enumerate() {
            if let Some(uri) = &buffer.uri {
                if uri.contains('\\') {
                    let message = "its uri has backslashes, which are read as slashes";
                    notices.warn(|| format!("buffer {index}"), message);
                }
                let longest: &mut u64 = longest.entry(uri.as_str()).or_default();
                *longest = buffer.byte_length.max(*longest);
            }
        }
        for (index, view) in document.buffer_views.iter().enumerate() {
            if view.byte_stride == Some(0) {
                let message = "its byteStride of 0 is read as elements without gaps";
                notices.warn(|| format!("bufferView {index}"), message);
            }
        }
        Self {
            document,
            chunk,
            folders,
            buffers: document.buffers.iter().map(|_| OnceCell::new()).collect(),
            decoded: document.buffer_views.iter().map(|_| OnceCell::new()).collect(),
            primitives: document.buffer_views.iter().map(|_| OnceCell::new()).collect(),
            contents: RefCell::default(),
            longest,
            files: RefCell::default(),
            budget: Budget {
                spent: Cell::new(0),
                read: Cell::new(read),
                unpacked: Cell::new(0),
                of_images: Cell::new(0),
            },
        }
    }

    /// The files that were read, each once, in the order in which they were needed.
    pub fn into_files(self) -> impl Iterator<Item = SourceFile> {
        self.files.into_inner().into_iter()
    }

    /// Counts `count` elements of `each` bytes that the file makes the loader expand. Call it before allocating them.
    pub fn spend(&self, count: usize, each: usize) -> Result<(), Fault> {
        let budget = &self.budget;
        let spent = budget.spent.get().saturating_add((count as u64).saturating_mul(each as u64));
        budget.spent.set(spent);
        let most = budget.most();
        if spent <= most {
            return Ok(());
        }
        let problem = format!(
            "the {} bytes that were read ask for {spent} bytes of geometry, more than the {most} allowed",
            budget.read.get()
        );
        Err(Fault::new("", problem).help(
            "it asks for data that is not there, or for the same data over and over; place a mesh several times instead",
        ))
    }

    /// Counts bytes that an image takes. Call it before allocating them.
    pub fn spend_on_image(&self, bytes: u64) -> Result<(), Fault> {
        let budget = &self.budget;
        let spent = budget.of_images.get().saturating_add(bytes);
        let read = budget.read.get().saturating_mul(Budget::FACTOR_OF_IMAGES);
        let most = Budget::BASE_OF_IMAGES.saturating_add(read);
        if spent > most {
            let problem = format!("the file's images would take {spent} bytes, more than the {most} allowed");
            return Err(Fault::new("", problem).help("smaller textures have smaller images"));
        }
        budget.of_images.set(spent);
        Ok(())
    }

    /// The bytes of an image as they are stored, compressed.
    pub fn image(&self, image: &schema::ImageJson) -> Result<Cow<'_, [u8]>, Fault> {
        let Some(uri) = image.uri.given() else {
            let view = image.buffer_view.given();
            let view = view.ok_or_else(|| Fault::new("", "it has neither a uri nor a bufferView"))?;
            return Ok(self.view(*view)?.bytes.into());
        };
        match files::resolve(uri, self.folders)? {
            Resolved::Data(bytes) => Ok(bytes.into()),
            Resolved::File(path) => {
                let (bytes, file) = files::read_image(uri, &path)?;
                let mut files = self.files.borrow_mut();
                if !files.contains(&file) {
                    self.budget.read.set(self.budget.read.get().saturating_add(file.bytes));
                    files.push(file);
                }
                Ok(bytes.into())
            }
        }
    }

    /// Counts `bytes` that `packed` bytes unpacked to.
    fn unpack(&self, packed: usize, bytes: u64) {
        let counted = bytes.min((packed as u64).saturating_mul(Budget::UNPACKED));
        self.budget.unpacked.set(self.budget.unpacked.get().saturating_add(counted));
    }

    fn buffer(&self, index: u32) -> Result<&[u8], Fault> {
        let at = index as usize;
        let Some((cell, buffer)) = self.buffers.get(at).zip(self.document.buffers.get(at)) else {
            return Err(missing("buffer", index, self.buffers.len()));
        };
        if let Some(content) = cell.get() {
            return Ok(content.bytes());
        }
        let content = self.load(at, buffer).map_err(|fault| fault.within(format!("buffer {index}")))?;
        Ok(cell.get_or_init(|| content).bytes())
    }

    fn load(&self, index: usize, buffer: &schema::Buffer) -> Result<Content<'a>, Fault> {
        let byte_length = buffer.byte_length;
        let too_short = |place: &str, found: usize| {
            let problem = format!("{place} has {found} bytes, but the buffer's byteLength is {byte_length}");
            Fault::new("", problem)
        };
        let length = usize::try_from(byte_length).unwrap_or(usize::MAX);
        let Some(uri) = &buffer.uri else {
            let chunk = self.chunk.filter(|_| index == 0).ok_or_else(|| {
                Fault::new("", "the buffer has no uri")
                    .help("only the first buffer of a .glb may have none: it is the file's binary chunk")
            })?;
            let bytes =
                chunk.get(..length).ok_or_else(|| too_short("the GLB's binary chunk", chunk.len()))?;
            return Ok(Content::Chunk(bytes));
        };
        match files::resolve(uri, self.folders)? {
            Resolved::Data(mut bytes) => {
                if bytes.len() < length {
                    return Err(too_short("the data: URI", bytes.len()));
                }
                bytes.truncate(length);
                Ok(Content::Own(bytes))
            }
            Resolved::File(path) => Ok(Content::File(self.file(uri, path, byte_length)?, length)),
        }
    }

    /// The content of a file up to byte `length` at least. A file is read once, or twice if another name of it asks for more.
    fn file(&self, uri: &str, path: PathBuf, length: u64) -> Result<Rc<Vec<u8>>, Fault> {
        let known = self.contents.borrow().get(&path).cloned();
        if let Some(known) = known.as_ref().filter(|known| known.len() as u64 >= length) {
            return Ok(known.clone());
        }
        let needed = self.longest.get(uri).copied().unwrap_or(length).max(length);
        let (mut bytes, file) = files::read_buffer(uri, &path, needed, length)?;
        if known.is_none() {
            let kept = bytes.len().min(usize::try_from(needed).unwrap_or(usize::MAX));
            bytes.truncate(kept);
            bytes.shrink_to_fit();
            self.budget.read.set(self.budget.read.get().saturating_add(kept as u64));
            self.files.borrow_mut().push(file);
        }
        let bytes = Rc::new(bytes);
        self.contents.borrow_mut().insert(path, bytes.clone());
        Ok(bytes)
    }

    fn slice(&self, buffer: u32, offset: u64, length: u64) -> Result<&[u8], Fault> {
        let bytes = self.buffer(buffer)?;
        let end = offset.checked_add(length);
        let range = usize::try_from(offset).ok().zip(end.and_then(|end| usize::try_from(end).ok()));
        range.and_then(|(start, end)| bytes.get(start..end)).ok_or_else(|| {
            let problem = format!(
                "{length} bytes from byte {offset} on lie outside buffer {buffer} of {} bytes",
                bytes.len()
            );
            Fault::new("", problem)
        })
    }

    fn view(&self, index: u32) -> Result<View<'_>, Fault> {
        let at = index as usize;
        let Some((cell, view)) = self.decoded.get(at).zip(self.document.buffer_views.get(at)) else {
            return Err(missing("bufferView", index, self.decoded.len()));
        };
        let read = || {
            let stride = view.byte_stride.filter(|stride| *stride > 0);
            if let Some(bytes) = cell.get() {
                return Ok(View { bytes, stride });
            }
            if let Some(compressed) = compressed(view)? {
                let bytes = self.decode(&compressed)?;
                if bytes.len() as u64 != view.byte_length {
                    let problem = format!(
                        "the view's byteLength is {}, but its compressed content has {} bytes",
                        view.byte_length,
                        bytes.len()
                    );
                    return Err(Fault::new("", problem));
                }
                return Ok(View { bytes: cell.get_or_init(|| bytes), stride });
            }
            let buffer = view.buffer.ok_or_else(|| Fault::new("", "it names no buffer"))?;
            Ok(View { bytes: self.slice(buffer, view.byte_offset, view.byte_length)?, stride })
        };
        read().map_err(|fault: Fault| {
            let other = view.extensions.keys().find(|name| !GEOMETRY.contains(&name.as_str()));
            let fault = match other {
                // Where the data are missing, they are in what is not read.
                Some(other) => fault
                    .help(format!("it has the extension {}, which beamcast does not read", quoted(other))),
                None => fault,
            };
            fault.within(format!("bufferView {index}"))
        })
    }

    fn decode(&self, compressed: &Compressed) -> Result<Vec<u8>, Fault> {
        let bytes = self.slice(compressed.buffer, compressed.byte_offset, compressed.byte_length)?;
        self.spend(compressed.count, compressed.byte_stride)?;
        let &Compressed { count, byte_stride, mode, filter, .. } = compressed;
        let decoded = meshopt::decode(bytes, count, byte_stride, mode, filter)
            .map_err(|error| Fault::new("", format!("the meshopt compression is broken: {error}")))?;
        self.unpack(bytes.len(), decoded.len() as u64);
        Ok(decoded)
    }

    /// The primitive that a view holds, compressed with Draco.
    pub fn draco(&self, view: u32) -> Result<&Draco, Fault> {
        let bytes = self.view(view)?.bytes;
        let cell = &self.primitives[view as usize];
        if let Some(known) = cell.get() {
            return Ok(known);
        }
        let left = self.budget.most().saturating_sub(self.budget.spent.get());
        let draco = Draco::decode(bytes, left)?;
        self.spend(draco.bytes(), 1)?;
        self.unpack(bytes.len(), draco.bytes() as u64);
        Ok(cell.get_or_init(|| draco))
    }

    /// Whether an accessor has data of its own, and is not all zeros for want of any.
    pub fn has_data(&self, accessor: u32) -> bool {
        let accessor = self.document.accessors.get(accessor as usize);
        accessor.is_none_or(|accessor| accessor.buffer_view.is_some() || accessor.sparse.is_some())
    }

    /// The elements of accessor `index`, which must have the layout, and `count` elements if a count is given.
    pub fn elements(&self, index: u32, layout: &Layout, count: Option<usize>) -> Result<Elements<'_>, Fault> {
        let Some(accessor) = self.document.accessors.get(index as usize) else {
            return Err(missing("accessor", index, self.document.accessors.len()));
        };
        let read = || {
            let elements = self.checked_elements(accessor, layout)?;
            match count {
                Some(count) if count != elements.count => Err(Fault::new(
                    "",
                    format!("{} has {} elements where {count} are needed", layout.purpose, elements.count),
                )),
                _ => Ok(elements),
            }
        };
        read().map_err(|fault: Fault| fault.within(format!("accessor {index}")))
    }

    fn checked_elements(&self, accessor: &Accessor, layout: &Layout) -> Result<Elements<'_>, Fault> {
        let (component, normalized) = layout.check(accessor)?;
        let size = component.size() * layout.kind.components();
        let count = accessor.count.ok_or_else(|| Fault::new("", "it has no count"))?;
        let count = usize::try_from(count)
            .map_err(|_| Fault::new("", format!("a count of {count} is not possible")))?;
        let base = match accessor.buffer_view {
            Some(view) => Some(self.strided(view, accessor.byte_offset, count, size)?),
            None => None,
        };
        let sparse = match &accessor.sparse {
            Some(sparse) => {
                Some(self.sparse(sparse, count, size).map_err(|fault: Fault| fault.within("sparse values"))?)
            }
            None => None,
        };
        let one = normalized.then(|| f64::from(largest_integer(component)));
        Ok(Elements { count, component, one, base, sparse })
    }

    /// The place of `count` elements of `size` bytes in a view.
    fn strided(&self, view: u32, offset: u64, count: usize, size: usize) -> Result<Strided<'_>, Fault> {
        let View { bytes, stride } = self.view(view)?;
        let stride = stride.unwrap_or(size);
        if stride < size {
            let problem = format!(
                "bufferView {view} has a byteStride of {stride}, less than the {size} bytes of an element"
            );
            return Err(Fault::new("", problem));
        }
        let needed = match count.checked_sub(1) {
            None => Some(0),
            Some(strides) => strides.checked_mul(stride).and_then(|length| length.checked_add(size)),
        };
        let available = usize::try_from(offset).ok().and_then(|offset| bytes.get(offset..));
        match (available, needed) {
            (Some(bytes), Some(needed)) if needed <= bytes.len() => Ok(Strided { bytes, stride }),
            _ => {
                let problem = format!(
                    "{count} elements of {size} bytes, {stride} apart, from byte {offset} on lie outside \
                     bufferView {view} of {} bytes",
                    bytes.len()
                );
                Err(Fault::new("", problem))
            }
        }
    }

    fn sparse(&self, sparse: &schema::Sparse, base_count: usize, size: usize) -> Result<Sparse<'_>, Fault> {
        let count = usize::try_from(sparse.count).unwrap_or(usize::MAX);
        if count > base_count {
            let problem = format!("there are {count} of them for {base_count} elements");
            return Err(Fault::new("", problem));
        }
        let index_type = Component::numbered(sparse.indices.component_type)
            .filter(|component| matches!(component, Component::U8 | Component::U16 | Component::U32));
        let Some(index_type) = index_type else {
            let problem = "the indices' componentType is none that indices may have";
            return Err(Fault::new("", problem).help("5121, 5123 or 5125: unsigned integers"));
        };
        let view = sparse.indices.buffer_view;
        let indices = self.strided(view, sparse.indices.byte_offset, count, index_type.size())?;
        if indices.stride != index_type.size() {
            return Err(Fault::new("", format!("bufferView {view} of indices may have no byteStride")));
        }
        let values = self.strided(sparse.values.buffer_view, sparse.values.byte_offset, count, size)?;
        let sparse = Sparse { count, index_type, indices: indices.bytes, values };
        // Checking takes time in proportion to the count, each time that the accessor is used.
        self.spend(count, index_type.size())?;
        let mut least = 0;
        for at in 0..count {
            let index = sparse.index(at);
            if index < least {
                let problem = format!("their indices do not strictly increase: number {at} is {index}");
                return Err(Fault::new("", problem));
            }
            if index >= base_count as u64 {
                return Err(Fault::new("", format!("index {index} is past the {base_count} elements")));
            }
            least = index + 1;
        }
        Ok(sparse)
    }
}

fn compressed(view: &schema::BufferView) -> Result<Option<Compressed>, Fault> {
    for name in ["EXT_meshopt_compression", "KHR_meshopt_compression"] {
        if let Some(value) = view.extensions.get(name) {
            let parsed = serde_json::from_str(RawValue::get(value));
            return parsed.map(Some).map_err(|error| Fault::new(name, error.to_string()));
        }
    }
    Ok(None)
}

impl Layout {
    /// The accessor's component type and whether it is normalised, if the layout allows them.
    fn check(&self, accessor: &Accessor) -> Result<(Component, bool), Fault> {
        let Some(kind) = Kind::named(&accessor.kind) else {
            let problem = "its type is none that glTF knows";
            return Err(Fault::new("", problem).help("SCALAR, VEC2, VEC3, VEC4, MAT2, MAT3 or MAT4"));
        };
        let Some(component) = Component::numbered(accessor.component_type) else {
            let problem = "its componentType is none that glTF knows";
            return Err(Fault::new("", problem).help("5120, 5121, 5122, 5123, 5125 or 5126"));
        };
        // The flag has no meaning for floats and 32-bit integers.
        let normalized = accessor.normalized && !matches!(component, Component::F32 | Component::U32);
        if kind == self.kind && self.components.contains(&(component, normalized)) {
            return Ok((component, normalized));
        }
        let wanted: Vec<_> = self.components.iter().map(|&(c, n)| describe(self.kind, c, n)).collect();
        let problem =
            format!("it is {}, which {} can't be", describe(kind, component, normalized), self.purpose);
        let mut help = format!("it takes {}", wanted.join(", "));
        if self.purpose == "POSITION" && kind == self.kind {
            help.push_str("; integers need KHR_mesh_quantization among the extensionsRequired");
        }
        Err(Fault::new("", problem).help(help))
    }
}

fn describe(kind: Kind, component: Component, normalized: bool) -> String {
    let normalized = if normalized { "normalized " } else { "" };
    format!("{} of {normalized}{}", kind.name(), component.name())
}

impl Strided<'_> {
    fn element(&self, index: usize) -> &[u8] {
        &self.bytes[index * self.stride..]
    }
}

impl Sparse<'_> {
    fn index(&self, at: usize) -> u64 {
        component(&self.indices[at * self.index_type.size()..], self.index_type) as u64
    }

    /// The position of element `index` among the values.
    fn find(&self, index: usize) -> Option<usize> {
        let (mut low, mut high) = (0, self.count);
        while low < high {
            let middle = low.midpoint(high);
            match self.index(middle).cmp(&(index as u64)) {
                std::cmp::Ordering::Equal => return Some(middle),
                std::cmp::Ordering::Less => low = middle + 1,
                std::cmp::Ordering::Greater => high = middle,
            }
        }
        None
    }
}

impl Elements<'_> {
    /// The number of elements.
    pub fn len(&self) -> usize {
        self.count
    }

    /// The elements of a list of `f32` that was decoded, `components` to an element. If integers stand for fractions, `one`
    /// stands for 1.
    pub fn decoded(bytes: &[u8], components: usize, one: Option<f64>) -> Elements<'_> {
        let stride = components * Component::F32.size();
        let base = Some(Strided { bytes, stride });
        Elements { count: bytes.len() / stride, component: Component::F32, one, base, sparse: None }
    }

    /// The integers of a list of `u32` that was decoded.
    pub fn decoded_integers(bytes: &[u8]) -> Elements<'_> {
        Elements { component: Component::U32, ..Elements::decoded(bytes, 1, None) }
    }

    /// The largest integer that a component can hold.
    pub fn largest_integer(&self) -> u32 {
        largest_integer(self.component)
    }

    /// The first `N` components of an element, which must have as many. Normalised components are converted as glTF defines
    /// it: max(c / 127, −1) for signed bytes, and so on. `index` must be less than [`Self::len`].
    pub fn get<const N: usize>(&self, index: usize) -> [f64; N] {
        let Some(bytes) = self.bytes(index) else { return [0.0; N] };
        let size = self.component.size();
        let mut values = [0.0; N];
        for (at, value) in values.iter_mut().enumerate() {
            *value = component(&bytes[at * size..], self.component);
        }
        if let Some(one) = self.one {
            values = values.map(|value| (value / one).max(-1.0));
        }
        values
    }

    /// The value of an element that is an unsigned integer. `index` must be less than [`Self::len`].
    pub fn integer(&self, index: usize) -> u32 {
        let Some(bytes) = self.bytes(index) else { return 0 };
        match self.component {
            Component::U8 => bytes[0].into(),
            Component::U16 => u16::from_le_bytes([bytes[0], bytes[1]]).into(),
            _ => u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
        }
    }

    fn bytes(&self, index: usize) -> Option<&[u8]> {
        if let Some(sparse) = &self.sparse
            && let Some(at) = sparse.find(index)
        {
            return Some(sparse.values.element(at));
        }
        self.base.as_ref().map(|base| base.element(index))
    }
}

/// The largest integer that a component can hold.
fn largest_integer(component: Component) -> u32 {
    match component {
        Component::I8 => i8::MAX as u32,
        Component::U8 => u8::MAX.into(),
        Component::I16 => i16::MAX as u32,
        Component::U16 => u16::MAX.into(),
        Component::U32 | Component::F32 => u32::MAX,
    }
}

/// The component at the start of `bytes`.
fn component(bytes: &[u8], kind: Component) -> f64 {
    match kind {
        Component::I8 => f64::from(bytes[0] as i8),
        Component::U8 => bytes[0].into(),
        Component::I16 => i16::from_le_bytes([bytes[0], bytes[1]]).into(),
        Component::U16 => u16::from_le_bytes([bytes[0], bytes[1]]).into(),
        Component::U32 => u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]).into(),
        Component::F32 => f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]).into(),
    }
}
