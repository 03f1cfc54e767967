//! The closed lists of values in `pipeline.toml`. Their doc comments are what an editor shows.
//!
//! Knows nothing of what the choices do: the rooms that act on them `match` on these types.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Declares an enum of names with `ALL`, `name` and `Display`, so that the list exists once.
macro_rules! choice {
    ($(#[$meta:meta])* $kind:ident { $($(#[$case_meta:meta])* $case:ident = $name:literal,)+ }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
        pub enum $kind { $($(#[$case_meta])* #[serde(rename = $name)] $case,)+ }

        impl $kind {
            /// Every case, in the order of the documentation.
            pub const ALL: &'static [Self] = &[$(Self::$case,)+];

            /// The name in `pipeline.toml` and in reports.
            pub fn name(self) -> &'static str {
                match self { $(Self::$case => $name,)+ }
            }
        }

        impl std::fmt::Display for $kind {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.name())
            }
        }
    };
}

choice! {
    /// What the contraction of an edge costs.
    Metric {
        /// One error over position, normals, texture coordinates and colours.
        #[default]
        Its = "its",
        /// Quadric error of positions alone (Garland and Heckbert 1997); fastest, blind to textures.
        Qem = "qem",
        /// One quadric over position and attributes together (Garland and Heckbert 1998).
        QemAttributes = "qem-attributes",
        /// Average distance and point clouds of attributes in one error; joins parts that no edge connects (Erikson and
        /// Manocha 1999).
        Gaps = "gaps",
        /// The instanced-model paper's algorithm as it is written (Tariq et al. 2012): for comparing; `its` is better.
        ItsPaper = "its-paper",
        /// Distance for each triangle saved: positions alone, comparable between meshes (Azim et al. 2015).
        Ias = "ias",
        /// The least bound on how far a texture moves over the surface, which each level then states (Cohen et al. 1998).
        Aps = "aps",
        /// The least deviation of the texture first; charts keep their borders, vertices their places in the texture (Sander et
        /// al. 2001).
        Tmpm = "tmpm",
        /// The shortest edge first, to its middle: the baseline of comparisons.
        Naive = "naive",
        /// Several recipes are tried for each mesh, and each level is taken from the one that looks best.
        Auto = "auto",
    }
}

choice! {
    /// How much work the simplifier spends on each mesh.
    Effort {
        /// Costs are summed along the way and never formed anew.
        Fast = "fast",
        /// Costs are formed anew from the mesh as it is now where that changes the order.
        #[default]
        Balanced = "balanced",
        /// For nightly builds: several recipes, then rounds in which each part of a surface gets the weight that
        /// pictures of its levels ask for; each level is the best-looking one.
        Best = "best",
    }
}

choice! {
    /// Where a vertex goes when an edge is contracted.
    Placement {
        /// The best form for each mesh: `subset` where levels share the source's vertices, else `optimal`.
        #[default]
        Auto = "auto",
        /// The point of least error; levels get vertices of their own.
        Optimal = "optimal",
        /// One of the two end points; levels can share the source's vertices.
        Subset = "subset",
    }
}

choice! {
    /// File format of the outputs.
    Format {
        /// As the source: `.glb` stays `.glb`, `.gltf` stays `.gltf`; `.obj` becomes `.glb`.
        #[default]
        Source = "source",
        /// One binary file.
        Glb = "glb",
        /// JSON with a `.bin` beside it.
        Gltf = "gltf",
    }
}

choice! {
    /// Where the vertices of the levels are kept.
    Storage {
        /// `compact` or `shared`, whichever makes the smaller file, chosen for each level.
        #[default]
        Smallest = "smallest",
        /// Each level has its own vertices: more bytes on disk, fewer in use when only a coarse level is loaded.
        Compact = "compact",
        /// Levels index the source's vertices and add indices only; implies placement `subset`.
        Shared = "shared",
    }
}

choice! {
    /// Where the geometry of meshes with levels is kept.
    Layout {
        /// In each scene's own files: an output can be moved and sent alone.
        #[default]
        SelfContained = "self-contained",
        /// In files that scenes share, `lodbake-library/HASH.bin` in the output folder: a mesh that many scenes have is written
        /// once, levels and all, and each of them refers to it. Only the whole output folder can be moved.
        Library = "library",
    }
}

choice! {
    /// The reader that the outputs are written for.
    Profile {
        /// three.js, Babylon.js and other readers of `MSFT_lod`.
        #[default]
        Web = "web",
        /// No required extension at all: Bevy, Interchange.
        Core = "core",
        /// Unity's glTF importers.
        Unity = "unity",
        /// Unreal Engine: screen sizes say where a level starts.
        Unreal = "unreal",
        /// Godot: levels are named with the suffix `_LODn`.
        Godot = "godot",
        /// Babylon.js with progressive loading, coarsest level first.
        BabylonStream = "babylon-stream",
    }
}

choice! {
    /// What draws the pictures that are compared. Figures of a graphics card differ from those of the reference by less
    /// than one in a hundred.
    Renderer {
        /// A graphics card where there is one, else `cpu`.
        #[default]
        Auto = "auto",
        /// A graphics card, or a driver that acts as one.
        Gpu = "gpu",
        /// The reference: the same figures on every machine.
        Cpu = "cpu",
    }
}

choice! {
    /// Which meshes of a scene that are another one of it, repeated, become instances of it.
    Recover {
        /// None: every mesh keeps bytes of its own.
        #[default]
        None = "none",
        /// Those with the same numbers, in whatever order.
        Exact = "exact",
        /// Also those that were moved and turned.
        Rigid = "rigid",
        /// Also those that were scaled, by the same factor in every direction.
        Similar = "similar",
        /// Also those that were mirrored: their nodes get a negative scale, which some readers draw inside out.
        Mirrored = "mirrored",
    }
}

choice! {
    /// How instances are written: nodes that show the same mesh.
    Instancing {
        /// As nodes. Every reader takes it, and each instance switches levels by itself.
        #[default]
        Nodes = "nodes",
        /// As batches of `EXT_mesh_gpu_instancing`, which take one draw call and switch levels as one.
        Gpu = "gpu",
    }
}

choice! {
    /// What the name of a node is worth, where the node would become part of a batch.
    NodeNames {
        /// A node with a name stays a node, so that a program can find it.
        #[default]
        Keep = "keep",
        /// Names are but labels, and go.
        Drop = "drop",
    }
}

choice! {
    /// Unit of a level's `error`.
    ErrorUnit {
        /// Fraction of the sub-mesh's bounding radius.
        #[default]
        Radius = "radius",
        /// Units of the sub-mesh's own space, before any transform of the scene.
        Object = "object",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_what_serde_reads() {
        for &metric in Metric::ALL {
            assert_eq!(serde_json::to_value(metric).unwrap(), metric.name());
        }
        for &profile in Profile::ALL {
            assert_eq!(serde_json::from_value::<Profile>(profile.name().into()).unwrap(), profile);
        }
    }
}
