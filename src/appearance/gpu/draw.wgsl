// One view in two passes: the rasteriser finds the nearest triangle of each pixel, a compute pass gives it its colour.
//
// The same steps in the same order as `raster.rs`, `shade.rs` and `texture.rs`, so that pictures differ from the
// reference only by the rounding of this machine's arithmetic: corners on 1/256 pixel, texture coordinates' exact
// derivatives, texels and their filter read from plain memory (hardware samplers filter with 8-bit weights).
//
// Constants in capitals that are not declared here are put before this text by `mod.rs`: LAMP, EVEN,
// LEAST_ROUGHNESS, BACKGROUND, STEPS, and the sizes and offsets of records.

struct View {
    // Pixels on each side.
    size: u32,
    // Depth is this over the distance in front of the camera.
    near: f32,
    // Where the tables of the transfer function and of the even light start in `words`.
    tables: u32,
    // 1: note faces.
    faces: u32,
}

// One part at one place, for one view.
struct Placed {
    // Rows of the matrix to clip space that give x, y and w.
    clip_x: vec4f,
    clip_y: vec4f,
    clip_w: vec4f,
    // Rows of the matrix to world space, with the camera as origin.
    to_x: vec4f,
    to_y: vec4f,
    to_z: vec4f,
    // Columns that turn directions and normals; not to scale. w of the first: the part's record in `words`.
    linear_x: vec4f,
    linear_y: vec4f,
    linear_z: vec4f,
    // w of the first: 1 where the transform mirrors.
    normal_x: vec4f,
    normal_y: vec4f,
    normal_z: vec4f,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> words: array<u32>;
@group(0) @binding(2) var<storage, read> texels: array<u32>;
@group(0) @binding(3) var<storage, read> places: array<Placed>;

@group(1) @binding(0) var seen: texture_2d<u32>;
@group(1) @binding(1) var<storage, read_write> pixels: array<u32>;

const NONE = 0xffffffffu;

// ---- numbers from words

fn number(at: u32) -> f32 { return bitcast<f32>(words[at]); }
fn pair(at: u32) -> vec2f { return vec2f(number(at), number(at + 1)); }
fn triple(at: u32) -> vec3f { return vec3f(number(at), number(at + 1), number(at + 2)); }
fn quadruple(at: u32) -> vec4f { return vec4f(triple(at), number(at + 3)); }

fn part_of(place: u32) -> u32 { return bitcast<u32>(places[place].linear_x.w); }
fn mirrored(place: u32) -> bool { return places[place].normal_x.w != 0.0; }

// ---- triangles on the screen

fn to_clip(place: u32, at: vec3f) -> vec3f {
    let p = vec4f(at, 1.0);
    return vec3f(dot(places[place].clip_x, p), dot(places[place].clip_y, p), dot(places[place].clip_w, p));
}

struct Corner {
    @builtin(position) position: vec4f,
    @location(0) @interpolate(flat, either) id: vec2u,
}

@vertex
fn corner(@builtin(vertex_index) vertex: u32, @builtin(instance_index) place: u32) -> Corner {
    let part = part_of(place);
    let index = words[words[part + PART_INDICES] + vertex];
    let p = to_clip(place, triple(words[part + PART_POSITIONS] + 3 * index));
    var out: Corner;
    // Depth in reverse; the fragment writes its own.
    out.position = vec4f(p.x, p.y, view.near, p.z);
    out.id = vec2u(place, vertex / 3);
    return out;
}

// A triangle, seen at the centre of a pixel.
struct Pixel {
    place: u32,
    part: u32,
    corners: vec3u,
    // Shares of the corners, corrected for perspective, and their change for one pixel to the right and up.
    at: vec3f,
    dx: vec3f,
    dy: vec3f,
    back: bool,
    // One over the distance in front of the camera.
    near: f32,
    x: u32,
    y: u32,
}

// Twice the area of a triangle, positive if `p` lies to the left of a → b.
fn edge(a: vec2f, b: vec2f, p: vec2f) -> f32 { return (b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x); }

// `x` from the left, `y` from the bottom.
fn pixel_of(place: u32, triangle: u32, x: u32, y: u32) -> Pixel {
    let part = part_of(place);
    let indices = words[part + PART_INDICES] + 3 * triangle;
    let positions = words[part + PART_POSITIONS];
    var corners = vec3u(words[indices], words[indices + 1], words[indices + 2]);
    let half = f32(view.size) * 0.5 * STEPS;
    // Measured from the pixel, where single precision is at home.
    let middle = vec2f(f32(x), f32(y)) * STEPS + STEPS * 0.5;
    var screen: array<vec2f, 3>;
    var near: vec3f;
    for (var i = 0u; i < 3u; i++) {
        let p = to_clip(place, triple(positions + 3 * corners[i]));
        near[i] = 1.0 / p.z;
        screen[i] = floor((p.xy * near[i] + 1.0) * half + 0.5) - middle;
    }
    let area = edge(screen[0], screen[1], screen[2]);
    if area < 0.0 {
        let s = screen[1];
        screen[1] = screen[2];
        screen[2] = s;
        near = near.xzy;
        corners = corners.xzy;
    }
    var pixel: Pixel;
    pixel.place = place;
    pixel.part = part;
    pixel.corners = corners;
    pixel.x = x;
    pixel.y = y;
    pixel.back = (area < 0.0) != mirrored(place);
    let inverse_area = 1.0 / max(abs(area), 1.0);
    let zero = vec2f(0.0);
    let flat_at = inverse_area * vec3f(
        edge(screen[1], screen[2], zero),
        edge(screen[2], screen[0], zero),
        edge(screen[0], screen[1], zero),
    );
    let scale = inverse_area * STEPS;
    let flat_dx = scale * vec3f(screen[1].y - screen[2].y, screen[2].y - screen[0].y, screen[0].y - screen[1].y);
    let flat_dy = scale * vec3f(screen[2].x - screen[1].x, screen[0].x - screen[2].x, screen[1].x - screen[0].x);
    // From the first corner on, as the reference has it: hardware interpolates from the picture's border, and of
    // surfaces that nearly touch the wrong one would be seen.
    let across = flat_dx.x * near.x + flat_dx.y * near.y + flat_dx.z * near.z;
    let upward = flat_dy.x * near.x + flat_dy.y * near.y + flat_dy.z * near.z;
    let off = -screen[0] * (1.0 / STEPS);
    let least = min(near.x, min(near.y, near.z));
    let most = max(near.x, max(near.y, near.z));
    let depth = clamp(near.x + upward * off.y + across * off.x, least, most);
    pixel.near = bitcast<f32>(bitcast<u32>(depth) & TOUCHING);
    let scaled = flat_at * near;
    let inverse = 1.0 / (scaled.x + scaled.y + scaled.z);
    pixel.at = scaled * inverse;
    let right = flat_dx * near;
    let up = flat_dy * near;
    pixel.dx = (right - pixel.at * (right.x + right.y + right.z)) * inverse;
    pixel.dy = (up - pixel.at * (up.x + up.y + up.z)) * inverse;
    return pixel;
}

// ---- textures

// log2 of a positive number, within 0.01.
fn rough_log2(x: f32) -> f32 {
    let bits = bitcast<u32>(x);
    let mantissa = bitcast<f32>((bits & 0x007fffffu) | 0x3f800000u);
    return f32(bits >> 23) - 127.0 + (-1.0 / 3.0 * mantissa + 2.0) * mantissa - 5.0 / 3.0;
}

fn modulo(a: i32, b: i32) -> i32 {
    let rest = a % b;
    return select(rest, rest + b, rest < 0);
}

fn wrapped(mode: u32, at: i32, size: i32) -> i32 {
    if mode == WRAP_CLAMP { return clamp(at, 0, size - 1); }
    if mode == WRAP_MIRROR {
        let there = modulo(at, 2 * size);
        return select(2 * size - 1 - there, there, there < size);
    }
    return modulo(at, size);
}

fn texel(at: u32, color: bool) -> vec4f {
    let bytes = texels[at];
    let parts = vec4u(bytes & 255u, (bytes >> 8) & 255u, (bytes >> 16) & 255u, bytes >> 24);
    let data = vec4f(parts) * (1.0 / 255.0);
    if !color { return data; }
    let light = view.tables;
    return vec4f(number(light + parts.x), number(light + parts.y), number(light + parts.z), data.w);
}

// A texel number and how far beyond its centre a coordinate is.
fn cell(coordinate: f32, size: i32) -> vec2f {
    let at = coordinate * f32(size) - 0.5;
    if !(at > -8.0e6 && at < 8.0e6) { return vec2f(0.0); }
    let whole = floor(at);
    return vec2f(whole, at - whole);
}

fn bilinear(texture: u32, number: u32, uv: vec2f, wrap: vec2u) -> vec4f {
    let level = texture + TEXTURE_LEVELS + 3 * min(number, words[texture + TEXTURE_COUNT] - 1);
    let start = words[level];
    let width = i32(words[level + 1]);
    let height = i32(words[level + 2]);
    let x = cell(uv.x, width);
    let y = cell(uv.y, height);
    let x0 = u32(wrapped(wrap.x, i32(x.x), width));
    let x1 = u32(wrapped(wrap.x, i32(x.x) + 1, width));
    let row0 = start + u32(wrapped(wrap.y, i32(y.x), height)) * u32(width);
    let row1 = start + u32(wrapped(wrap.y, i32(y.x) + 1, height)) * u32(width);
    let color = words[texture + TEXTURE_COLOR] != 0u;
    let a = texel(row0 + x0, color);
    let b = texel(row0 + x1, color);
    let c = texel(row1 + x0, color);
    let d = texel(row1 + x1, color);
    let top = a + (b - a) * x.y;
    let bottom = c + (d - c) * x.y;
    return top + (bottom - top) * y.y;
}

fn sample(texture: u32, uv: vec2f, right: vec2f, up: vec2f, wrap: vec2u) -> vec4f {
    let size = vec2f(f32(words[texture + TEXTURE_LEVELS + 1]), f32(words[texture + TEXTURE_LEVELS + 2]));
    let dx = right * size;
    let dy = up * size;
    let span = max(dot(dx, dx), dot(dy, dy));
    let last = f32(words[texture + TEXTURE_COUNT] - 1);
    var lambda = 0.0;
    if !(span <= 1.0) { lambda = min(0.5 * rough_log2(span), last); }
    if !(lambda >= 0.0) { lambda = last; }
    let fine = u32(lambda);
    let part = lambda - f32(fine);
    let a = bilinear(texture, fine, uv, wrap);
    if part <= 0.0 { return a; }
    return a + (bilinear(texture, fine + 1, uv, wrap) - a) * part;
}

fn direction(use_at: u32, uv: vec2f) -> vec2f { return pair(use_at + USE_U) * uv.x + pair(use_at + USE_V) * uv.y; }

fn has(pixel: ptr<function, Pixel>, use_at: u32) -> bool {
    return words[use_at + USE_TEXTURE] != NONE && words[(*pixel).part + PART_UVS + words[use_at + USE_SET]] != NONE;
}

fn corners2(pixel: ptr<function, Pixel>, start: u32) -> array<vec2f, 3> {
    let c = (*pixel).corners;
    return array<vec2f, 3>(pair(start + 2 * c.x), pair(start + 2 * c.y), pair(start + 2 * c.z));
}

// Only where `has`.
fn texture_at(pixel: ptr<function, Pixel>, use_at: u32) -> vec4f {
    let uv = corners2(pixel, words[(*pixel).part + PART_UVS + words[use_at + USE_SET]]);
    let at = (*pixel).at;
    let dx = (*pixel).dx;
    let dy = (*pixel).dy;
    let middle = uv[0] * at.x + uv[1] * at.y + uv[2] * at.z;
    let right = uv[0] * dx.x + uv[1] * dx.y + uv[2] * dx.z;
    let up = uv[0] * dy.x + uv[1] * dy.y + uv[2] * dy.z;
    let point = direction(use_at, middle) + pair(use_at + USE_OFFSET);
    let wrap = vec2u(words[use_at + USE_WRAP], words[use_at + USE_WRAP + 1]);
    return sample(words[use_at + USE_TEXTURE], point, direction(use_at, right), direction(use_at, up), wrap);
}

fn mixed3(pixel: ptr<function, Pixel>, start: u32) -> vec3f {
    let c = (*pixel).corners;
    let at = (*pixel).at;
    return triple(start + 3 * c.x) * at.x + triple(start + 3 * c.y) * at.y + triple(start + 3 * c.z) * at.z;
}

fn mixed4(pixel: ptr<function, Pixel>, start: u32) -> vec4f {
    let c = (*pixel).corners;
    let at = (*pixel).at;
    return quadruple(start + 4 * c.x) * at.x + quadruple(start + 4 * c.y) * at.y + quadruple(start + 4 * c.z) * at.z;
}

// ---- what is seen

fn base_color(pixel: ptr<function, Pixel>, material: u32) -> vec4f {
    var base = quadruple(material + MATERIAL_BASE);
    let colors = words[(*pixel).part + PART_COLORS];
    if colors != NONE { base *= mixed4(pixel, colors); }
    if has(pixel, material + MATERIAL_BASE_USE) { base *= texture_at(pixel, material + MATERIAL_BASE_USE); }
    return base;
}

struct Nearest {
    @location(0) id: vec2u,
    @builtin(frag_depth) depth: f32,
}

@fragment
fn nearest(in: Corner, @builtin(front_facing) front: bool) -> Nearest {
    let part = part_of(in.id.x);
    let material = words[part + PART_MATERIAL];
    if words[material + MATERIAL_DOUBLE_SIDED] == 0u && front == mirrored(in.id.x) { discard; }
    let alpha = words[material + MATERIAL_ALPHA];
    let x = u32(in.position.x);
    let y = view.size - 1 - u32(in.position.y);
    var pixel = pixel_of(in.id.x, in.id.y, x, y);
    if alpha != ALPHA_OPAQUE {
        let a = base_color(&pixel, material).w;
        if alpha == ALPHA_MASK {
            if !(a >= number(material + MATERIAL_CUTOFF)) { discard; }
        } else {
            var door = array<f32, 16>(SCREEN_DOOR);
            if !(a * 16.0 > door[y % 4 * 4 + x % 4] + 0.5) { discard; }
        }
    }
    return Nearest(in.id, pixel.near * view.near);
}

// ---- its colour

fn unit_or_zero(v: vec3f) -> vec3f {
    let inverse = 1.0 / length(v);
    // Too short or too long for a direction.
    if !(inverse > 0.0 && inverse < 3.0e38) { return vec3f(0.0); }
    return v * inverse;
}

fn turned(place: u32, normal: vec3f) -> vec3f {
    return places[place].normal_x.xyz * normal.x + places[place].normal_y.xyz * normal.y
        + places[place].normal_z.xyz * normal.z;
}

fn led(place: u32, tangent: vec3f) -> vec3f {
    return places[place].linear_x.xyz * tangent.x + places[place].linear_y.xyz * tangent.y
        + places[place].linear_z.xyz * tangent.z;
}

fn positions_of(pixel: ptr<function, Pixel>) -> mat3x3f {
    let start = words[(*pixel).part + PART_POSITIONS];
    let c = (*pixel).corners;
    return mat3x3f(triple(start + 3 * c.x), triple(start + 3 * c.y), triple(start + 3 * c.z));
}

fn shading_normal(pixel: ptr<function, Pixel>, material: u32) -> vec3f {
    let place = (*pixel).place;
    let smooth_normal = mixed3(pixel, words[(*pixel).part + PART_NORMALS]);
    let normal = unit_or_zero(turned(place, smooth_normal));
    let p = positions_of(pixel);
    if all(normal == vec3f(0.0)) {
        let flat_normal = unit_or_zero(turned(place, cross(p[1] - p[0], p[2] - p[0])));
        return select(-flat_normal, flat_normal, (*pixel).back == mirrored(place));
    }
    let use_at = material + MATERIAL_NORMAL_USE;
    if !has(pixel, use_at) { return normal; }
    var tangent: vec3f;
    var bitangent: vec3f;
    let tangents = words[(*pixel).part + PART_TANGENTS];
    if tangents != NONE {
        tangent = mixed4(pixel, tangents).xyz;
        bitangent = cross(smooth_normal, tangent) * number(tangents + 4 * (*pixel).corners.x + 3);
    } else {
        let uv = corners2(pixel, words[(*pixel).part + PART_UVS + words[use_at + USE_SET]]);
        let s = direction(use_at, uv[1] - uv[0]);
        let t = direction(use_at, uv[2] - uv[0]);
        let area = s.x * t.y - s.y * t.x;
        if area == 0.0 { return normal; }
        let facing = select(1.0, -1.0, area < 0.0);
        tangent = ((p[1] - p[0]) * t.y - (p[2] - p[0]) * s.y) * facing;
        bitangent = ((p[1] - p[0]) * t.x - (p[2] - p[0]) * s.x) * facing;
    }
    tangent = led(place, tangent);
    tangent = unit_or_zero(tangent - normal * dot(normal, tangent));
    bitangent = led(place, bitangent);
    bitangent = unit_or_zero(bitangent - normal * dot(normal, bitangent));
    if all(tangent == vec3f(0.0)) || all(bitangent == vec3f(0.0)) { return normal; }
    var bump = texture_at(pixel, use_at).xyz * 2.0 - 1.0;
    let scale = number(material + MATERIAL_NORMAL_SCALE);
    let bent = unit_or_zero(tangent * (bump.x * scale) + bitangent * (bump.y * scale) + normal * bump.z);
    return select(bent, normal, all(bent == vec3f(0.0)));
}

// The lamp's reflection, for light = view = half vector (GGX, Smith).
fn highlight(facing: f32, roughness: f32) -> f32 {
    let a = roughness * roughness;
    let a2 = a * a;
    let f2 = facing * facing;
    let d = f2 * (a2 - 1.0) + 1.0;
    return a2 / (d * d) * 0.25 / sqrt(f2 * (1.0 - a2) + a2);
}

// The even light's: factor of the specular colour and what comes on top.
fn surround(facing: f32, roughness: f32) -> vec2f {
    let x = 1.0 - roughness;
    let y = 0.0425 - 0.0275 * roughness;
    let fall_off = number(view.tables + TABLE_FALL_OFF + u32(facing * 255.0 + 0.5));
    let a = min(x * x, fall_off) * x + y;
    return vec2f(1.04 - 0.572 * roughness - 1.04 * a, 1.04 * a + 0.022 * roughness - 0.04);
}

fn lit(pixel: ptr<function, Pixel>, material: u32, base: vec3f) -> vec3f {
    let place = (*pixel).place;
    let at = vec4f(mixed3(pixel, words[(*pixel).part + PART_POSITIONS]), 1.0);
    let seen_at = vec3f(dot(places[place].to_x, at), dot(places[place].to_y, at), dot(places[place].to_z, at));
    let eye = unit_or_zero(-seen_at);
    var normal = shading_normal(pixel, material);
    if (*pixel).back { normal = -normal; }
    let facing = clamp(dot(normal, eye), 0.0, 1.0);
    var metallic = number(material + MATERIAL_METALLIC);
    var roughness = number(material + MATERIAL_ROUGHNESS);
    if has(pixel, material + MATERIAL_METALLIC_ROUGHNESS_USE) {
        let value = texture_at(pixel, material + MATERIAL_METALLIC_ROUGHNESS_USE);
        metallic *= value.z;
        roughness *= value.y;
    }
    roughness = max(roughness, LEAST_ROUGHNESS);
    let specular = vec3f(0.04) * (1.0 - metallic) + base * metallic;
    let diffuse = base * ((1.0 - metallic) * 0.96);
    var light = diffuse * (LAMP * facing + EVEN) + specular * (LAMP * highlight(facing, roughness));
    let even = surround(facing, roughness);
    light += (specular * even.x + even.y) * EVEN;
    var emissive = triple(material + MATERIAL_EMISSIVE);
    if any(emissive != vec3f(0.0)) && has(pixel, material + MATERIAL_EMISSIVE_USE) {
        emissive *= texture_at(pixel, material + MATERIAL_EMISSIVE_USE).xyz;
    }
    return light + emissive;
}

// The nearest byte of some light, by the same thresholds as `Srgb::byte`.
fn byte(light: f32) -> u32 {
    let clamped = select(0.0, min(light, 1.0), light > 0.0);
    var encoded = 12.92 * clamped;
    if clamped > 0.0031308 { encoded = 1.055 * pow(clamped, 1.0 / 2.4) - 0.055; }
    var guess = u32(clamp(encoded * 255.0 + 0.5, 0.0, 255.0));
    let least = view.tables + TABLE_LEAST;
    if guess > 0u && clamped < number(least + guess) { guess -= 1u; }
    if clamped >= number(least + guess + 1) { guess += 1u; }
    return guess;
}

@compute @workgroup_size(8, 8)
fn color(@builtin(global_invocation_id) at: vec3u) {
    if at.x >= view.size || at.y >= view.size { return; }
    let out = at.y * view.size + at.x;
    let id = textureLoad(seen, at.xy, 0).xy;
    if id.x == NONE {
        pixels[out] = BACKGROUND;
        if view.faces != 0u { pixels[view.size * view.size + out] = NONE; }
        return;
    }
    var pixel = pixel_of(id.x, id.y, at.x, view.size - 1 - at.y);
    let material = words[pixel.part + PART_MATERIAL];
    var light = base_color(&pixel, material).xyz;
    if words[material + MATERIAL_UNLIT] == 0u { light = lit(&pixel, material, light); }
    pixels[out] = byte(light.x) | (byte(light.y) << 8) | (byte(light.z) << 16) | 0xff000000u;
    if view.faces != 0u { pixels[view.size * view.size + out] = words[pixel.part + PART_FIRST_FACE] + id.y; }
}
