//! The renderer of graphics cards, by way of wgpu: Vulkan, Metal, Direct3D 12. Pictures like those of the reference,
//! in less time; they differ from it by the rounding of the card's arithmetic, and so does a figure (see
//! `ARCHITECTURE.md` for how much). On one adapter and driver the same drawable gives the same picture bit for bit.
//!
//! The only place that knows wgpu. Knows drawables and cameras; not what is measured in the pictures.

mod pack;

use std::sync::mpsc;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use wgpu::util::{BufferInitDescriptor, DeviceExt as _};

use self::pack::{Packed, Place};
use super::drawable::{Drawable, NO_FACE};
use super::raster::LARGEST_SIZE;
use super::render::{Picture, Prepared, Render, RenderError, Shot};
use super::shade::{BACKGROUND, EVEN, LAMP, LEAST_ROUGHNESS, SCREEN_DOOR};
use super::views::Camera;

/// Which adapters will do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Adapters {
    /// Graphics cards only.
    Hardware,
    /// Programs that act as one as well, such as Mesa's.
    Any,
}

/// A graphics card, ready to draw.
pub struct Gpu {
    device: wgpu::Device,
    queue: wgpu::Queue,
    /// Finds the nearest triangle of each pixel.
    nearest: wgpu::RenderPipeline,
    /// Gives each pixel its colour.
    color: wgpu::ComputePipeline,
    name: String,
    /// The first error that no call returned.
    failed: Arc<Mutex<Option<String>>>,
}

/// Format of "which triangle of which instance".
const SEEN: wgpu::TextureFormat = wgpu::TextureFormat::Rg32Uint;
const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// A view that takes longer than this has hung.
const PATIENCE: Duration = Duration::from_secs(60);

impl Gpu {
    /// Opens the best adapter of a kind: a card of its own before one in the processor before a program.
    pub fn open(adapters: Adapters) -> Result<Self, RenderError> {
        if adapters == Adapters::Hardware && !may_have_hardware() {
            return Err(RenderError::NoAdapter);
        }
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
            backends: wgpu::Backends::PRIMARY,
            // The same in every build.
            flags: wgpu::InstanceFlags::empty(),
            ..wgpu::InstanceDescriptor::new_without_display_handle()
        });
        let found = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY));
        let fit = found.into_iter().filter_map(|adapter| Some((rank(&adapter.get_info(), adapters)?, adapter)));
        let best = fit.min_by_key(|(rank, _)| *rank);
        let Some((_, adapter)) = best else { return Err(RenderError::NoAdapter) };
        let info = adapter.get_info();
        let name = [info.name, info.driver, info.driver_info].into_iter().filter(|part| !part.is_empty());
        let name = name.collect::<Vec<_>>().join(", ");
        let refused = |error: wgpu::RequestDeviceError| RenderError::Device(error.to_string());
        let (device, queue) = pollster::block_on(
            adapter.request_device(&wgpu::DeviceDescriptor { required_limits: adapter.limits(), ..Default::default() }),
        )
        .map_err(refused)?;
        let failed = Arc::new(Mutex::new(None));
        let told = Arc::clone(&failed);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            told.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert_with(|| error.to_string());
        }));
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("draw.wgsl"),
            source: wgpu::ShaderSource::Wgsl(source().into()),
        });
        let (nearest, color) = (nearest(&device, &module), color(&device, &module));
        let gpu = Self { device, queue, nearest, color, name, failed };
        gpu.check()?;
        Ok(gpu)
    }

    /// Adapter and driver, for records.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What went wrong in a call that returned nothing.
    fn check(&self) -> Result<(), RenderError> {
        match &*self.failed.lock().unwrap_or_else(PoisonError::into_inner) {
            None => Ok(()),
            Some(text) => Err(RenderError::Device(text.clone())),
        }
    }

    fn texture(&self, format: wgpu::TextureFormat, size: u32, usage: wgpu::TextureUsages) -> wgpu::TextureView {
        let texture = self.device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d { width: size, height: size, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: usage | wgpu::TextureUsages::RENDER_ATTACHMENT,
            view_formats: &[],
        });
        texture.create_view(&wgpu::TextureViewDescriptor::default())
    }

    fn buffer(&self, contents: &[u8], usage: wgpu::BufferUsages) -> wgpu::Buffer {
        self.device.create_buffer_init(&BufferInitDescriptor { label: None, contents, usage })
    }

    fn empty_buffer(&self, size: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
    }

    /// Is an array of this many bytes too long for a shader?
    fn fits(&self, bytes: usize) -> Result<(), RenderError> {
        let most = self.device.limits().max_storage_buffer_binding_size;
        if bytes as u64 > most { Err(RenderError::TooLarge { bytes: bytes as u64, most }) } else { Ok(()) }
    }
}

/// Without a device file there is no card, and asking the drivers would cost time; some of them complain on standard
/// error about a missing desktop.
fn may_have_hardware() -> bool {
    const DEVICES: [&str; 3] = ["/dev/dri", "/dev/nvidiactl", "/dev/dxg"];
    !cfg!(target_os = "linux") || DEVICES.iter().any(|path| std::path::Path::new(path).exists())
}

/// Lower is better; none for adapters that will not do.
fn rank(info: &wgpu::AdapterInfo, adapters: Adapters) -> Option<u32> {
    match info.device_type {
        wgpu::DeviceType::DiscreteGpu => Some(0),
        wgpu::DeviceType::IntegratedGpu => Some(1),
        wgpu::DeviceType::VirtualGpu => Some(2),
        wgpu::DeviceType::Other | wgpu::DeviceType::Cpu => (adapters == Adapters::Any).then_some(3),
    }
}

/// The shader with the constants that Rust has, so that they exist once.
fn source() -> String {
    let [r, g, b] = BACKGROUND.map(u32::from);
    let door = SCREEN_DOOR.map(|step| format!("{step}.0")).join(", ");
    let mut lines: Vec<String> = Vec::new();
    let mut define = |name: &str, value: String| lines.push(format!("const {name} = {value};\n"));
    define("LAMP", format!("{LAMP:?}f"));
    define("EVEN", format!("{EVEN:?}f"));
    define("LEAST_ROUGHNESS", format!("{LEAST_ROUGHNESS:?}f"));
    define("STEPS", format!("{}.0", super::raster::STEPS));
    define("TOUCHING", format!("{}u", super::raster::TOUCHING));
    define("BACKGROUND", format!("{}u", r | g << 8 | b << 16));
    for (name, value) in pack::OFFSETS {
        define(name, format!("{value}u"));
    }
    lines.concat() + &include_str!("draw.wgsl").replace("(SCREEN_DOOR)", &format!("({door})"))
}

fn nearest(device: &wgpu::Device, module: &wgpu::ShaderModule) -> wgpu::RenderPipeline {
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("nearest"),
        layout: None,
        vertex: wgpu::VertexState {
            module,
            entry_point: Some("corner"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(true),
            // The first of equals stays, as in the reference.
            depth_compare: Some(wgpu::CompareFunction::Greater),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some("nearest"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[Some(SEEN.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}

fn color(device: &wgpu::Device, module: &wgpu::ShaderModule) -> wgpu::ComputePipeline {
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("color"),
        layout: None,
        module,
        entry_point: Some("color"),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    })
}

impl Render for Gpu {
    fn prepare<'a>(&'a self, drawable: &'a Drawable) -> Result<Box<dyn Prepared + 'a>, RenderError> {
        let packed = Packed::new(drawable);
        let places = drawable.instances.len() * size_of::<Place>();
        for bytes in [packed.words.len() * 4, packed.texels.len() * 4, places] {
            self.fits(bytes)?;
        }
        let storage = wgpu::BufferUsages::STORAGE;
        let words = self.buffer(bytemuck::cast_slice(&packed.words), storage);
        let texels = self.buffer(bytemuck::cast_slice(&packed.texels), storage);
        Ok(Box::new(GpuScene { gpu: self, drawable, packed: packed.into_outline(), words, texels }))
    }
}

struct GpuScene<'a> {
    gpu: &'a Gpu,
    drawable: &'a Drawable,
    packed: pack::Outline,
    words: wgpu::Buffer,
    texels: wgpu::Buffer,
}

/// As `View` in the shader.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct View {
    size: u32,
    near: f32,
    tables: u32,
    faces: u32,
}

impl Prepared for GpuScene<'_> {
    fn draw(&self, camera: &Camera, shot: Shot) -> Result<Picture, RenderError> {
        let (gpu, size) = (self.gpu, shot.size);
        if size == 0 || size > LARGEST_SIZE {
            return Err(RenderError::Size(size));
        }
        let pixels = size as usize * size as usize;
        let bytes = (pixels * if shot.faces { 8 } else { 4 }) as u64;
        gpu.fits(bytes as usize)?;
        let view = View { size, near: camera.near as f32, tables: self.packed.tables, faces: shot.faces.into() };
        let view = gpu.buffer(bytemuck::bytes_of(&view), wgpu::BufferUsages::UNIFORM);
        let mut places: Vec<Place> = self.packed.places(self.drawable, camera);
        if places.is_empty() {
            places.push(bytemuck::Zeroable::zeroed()); // a buffer cannot be empty
        }
        let places = gpu.buffer(bytemuck::cast_slice(&places), wgpu::BufferUsages::STORAGE);
        let seen = gpu.texture(SEEN, size, wgpu::TextureUsages::TEXTURE_BINDING);
        let depth = gpu.texture(DEPTH, size, wgpu::TextureUsages::empty());
        let out = gpu.empty_buffer(bytes, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC);
        let back = gpu.empty_buffer(bytes, wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST);

        let scene = |layout: &wgpu::BindGroupLayout| {
            let buffers = [&view, &self.words, &self.texels, &places];
            let entries: Vec<_> =
                (0..).zip(buffers).map(|(at, buffer)| bound(at, buffer.as_entire_binding())).collect();
            gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
        };
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let nobody = wgpu::Color { r: f64::from(NO_FACE), g: f64::from(NO_FACE), b: 0.0, a: 0.0 };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &seen,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Clear(nobody), store: wgpu::StoreOp::Store },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &depth,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Discard }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        pass.set_pipeline(&gpu.nearest);
        pass.set_bind_group(0, &scene(&gpu.nearest.get_bind_group_layout(0)), &[]);
        for (corners, instances) in pack::draws(self.drawable) {
            pass.draw(0..corners, instances);
        }
        drop(pass);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&gpu.color);
        pass.set_bind_group(0, &scene(&gpu.color.get_bind_group_layout(0)), &[]);
        let entries = [bound(0, wgpu::BindingResource::TextureView(&seen)), bound(1, out.as_entire_binding())];
        let layout = &gpu.color.get_bind_group_layout(1);
        let picture =
            gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries });
        pass.set_bind_group(1, &picture, &[]);
        pass.dispatch_workgroups(size.div_ceil(8), size.div_ceil(8), 1);
        drop(pass);
        encoder.copy_buffer_to_buffer(&out, 0, &back, 0, bytes);
        let submitted = gpu.queue.submit([encoder.finish()]);
        let (tell, told) = mpsc::channel();
        back.map_async(wgpu::MapMode::Read, .., move |result| drop(tell.send(result)));
        let wait = wgpu::PollType::Wait { submission_index: Some(submitted), timeout: Some(PATIENCE) };
        gpu.device.poll(wait).map_err(|error| RenderError::Device(error.to_string()))?;
        gpu.check()?;
        // Another thread's wait may have run into this one's answer and be about to tell it.
        let answer = told.recv_timeout(PATIENCE).map_err(|error| RenderError::Device(error.to_string()))?;
        answer.map_err(|error| RenderError::Device(error.to_string()))?;
        let mapped = back.get_mapped_range(..).map_err(|error| RenderError::Device(error.to_string()))?;
        let bytes: &[u8] = &mapped;
        let mut words = bytes.chunks_exact(4).map(|word| [word[0], word[1], word[2], word[3]]);
        let drawn = words.by_ref().take(pixels).collect();
        Ok(Picture { size, pixels: drawn, faces: words.map(u32::from_le_bytes).collect() })
    }
}

fn bound(binding: u32, resource: wgpu::BindingResource<'_>) -> wgpu::BindGroupEntry<'_> {
    wgpu::BindGroupEntry { binding, resource }
}
