//! Every default of `pipeline.toml`, each with the reason for its value.
//!
//! Knows nothing of how they are read; `file.rs` publishes them in the schema and `resolve.rs` applies them.

/// Files that are taken as scenes. Matching ignores case, so `LAMP.GLB` is found too.
pub const INCLUDE: [&str; 3] = ["**/*.glb", "**/*.gltf", "**/*.obj"];

/// Folder of the cache, beside `pipeline.toml`.
pub const CACHE: &str = ".lodbake";

/// Allowed error on the screen, in pixels: below one pixel a change of outline cannot be seen in a still picture.
pub const PIXELS: f64 = 1.0;

/// Height of the screen in pixels that `pixels` refers to: the most common one.
pub const SCREEN_HEIGHT: f64 = 1080.0;

/// Vertical field of view in degrees: the default camera of the common engines (three.js examples, Unity).
pub const FIELD_OF_VIEW: f64 = 60.0;

/// Weight of normals in the error. Weights of attributes must be small beside the geometry: 0.003 gave the smallest
/// image error of the values from 0.0005 to 0.03 over eight textured assets at four levels.
pub const NORMAL: f64 = 0.003;

/// Weight of texture coordinates (each set), from the same sweep.
pub const TEXCOORD: f64 = 0.3;

/// Weight of vertex colours. Colours are constant or smooth on most assets and share the range 0…1 with texture
/// coordinates, but move no texture under them: a third of that weight.
pub const COLOR: f64 = 0.1;

/// Weight of open borders. 0 is ruinous: cloth and leaves shrink away from their outline.
pub const BORDER: f64 = 1.0;

/// Weight of material and texture seams, from the same sweep as [`NORMAL`].
pub const SEAM: f64 = 0.3;

/// Weight of creases (edges where normals part). The faces beside a crease already hold it in place: little is needed. On a
/// flat-shaded model, where every edge is one, 0.04 beat 0.01 by 9 % of the image difference; on a helmet, a gun and a guitar
/// it cost 0.3 % (`docs/quality.md`).
pub const CREASE: f64 = 0.04;

/// Sub-meshes with fewer triangles are left alone. Such a mesh is one wave of a GPU's vertex work, so a level saves no
/// time, and the scene text of a level (a node, a mesh, accessors) is larger than the triangles it would save.
pub const MIN_TRIANGLES: u32 = 64;

/// Recipes that metric `auto` and effort `best` try: each costs one simplification and its pictures, and weights of normals
/// (the first three recipes) matter most.
pub const CANDIDATES: u32 = 3;

/// Pixels on each side of the pictures that are only recorded. A sixty-fourth of the metric's 512² pixels orders levels in
/// nearly the same way: rank correlation 0.991 over 44 levels of eleven assets (`tests/bench/look_size.py`). In a folder of many
/// small meshes pictures are most of a bake's work.
pub const LOOK_SIZE: u32 = 64;

/// The same where looks decide which level is taken: rank correlation 0.997.
pub const DECIDING_LOOK_SIZE: u32 = 128;

/// What may be left between a mesh and the instance that it becomes, as a fraction of the radius: a hundredth of a pixel on a
/// mesh that fills a screen, and thirty times what single precision rounds away on its way through a transform.
pub const TOLERANCE: f64 = 1e-5;

/// Radius of a batch of instances at most, in radii of its largest instance. A batch shows a level only where its nearest instance
/// may: its far side, twice this radius away, gets more triangles than it needs. Smaller ones cost draw calls.
pub const CELL: f64 = 32.0;

/// Levels where `[[lod]]` is absent: shares of the source's triangles.
pub const RATIOS: [f64; 3] = [0.5, 0.25, 0.1];
