//! Animated PNG files.

use lodsmith_core::Image;
use png::{BitDepth, BlendOp, ColorType, DisposeOp, Encoder, EncodingError};

/// Shape of an animation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AnimationOptions {
    /// Number of frames.
    pub frames: u32,
    /// Frames per second.
    pub fps: u16,
    /// True if pixels may be transparent; otherwise opacity is left out.
    pub has_alpha: bool,
}

/// Errors of encoding an animation.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AnimationError {
    /// Error of the encoder.
    #[error("{0}")]
    Codec(#[from] EncodingError),
    /// A frame does not have the size of the first, or the number of frames is not the declared one.
    #[error("all frames of an animation must have the same size, and their number must be the declared one")]
    Frames,
}

/// Encodes frames as an animated PNG that repeats forever.
///
/// Each frame after the first stores only the rectangle that differs from the previous frame, so a still background
/// costs nothing. Programs that do not know animations show the first frame. Only two frames are in memory at a time,
/// beside the file. Deterministic.
///
/// # Errors
/// The first error of a frame; [`AnimationError`] if there is none, if the sizes differ, or if their number is not that
/// of `options`.
pub fn encode_animation<E: From<AnimationError>>(
    options: AnimationOptions,
    frames: impl IntoIterator<Item = Result<Image, E>>,
) -> Result<Vec<u8>, E> {
    let codec = |error: EncodingError| E::from(AnimationError::from(error));
    let mut file = Vec::new();
    let mut frames = frames.into_iter();
    let mut before = frames.next().ok_or(AnimationError::Frames)??;
    let (width, height) = (before.width(), before.height());
    let mut encoder = Encoder::new(&mut file, width as u32, height as u32);
    encoder.set_color(if options.has_alpha { ColorType::Rgba } else { ColorType::Rgb });
    encoder.set_depth(BitDepth::Eight);
    encoder.set_animated(options.frames, 0).map_err(codec)?;
    encoder.set_frame_delay(1, options.fps.max(1)).map_err(codec)?;
    encoder.set_dispose_op(DisposeOp::None).map_err(codec)?;
    encoder.set_blend_op(BlendOp::Source).map_err(codec)?;
    let mut writer = encoder.write_header().map_err(codec)?;
    let mut buffer = Vec::new();
    pixels(&before, [0, 0, width, height], options.has_alpha, &mut buffer);
    writer.write_image_data(&buffer).map_err(codec)?;
    let mut count = 1;
    for frame in frames {
        let frame = frame?;
        if (frame.width(), frame.height()) != (width, height) || count == options.frames {
            return Err(AnimationError::Frames.into());
        }
        let area = changed_area(&before, &frame);
        let [left, top, w, h] = area.map(|x| x as u32);
        // The frame must stay within the image at each step.
        writer.reset_frame_position().map_err(codec)?;
        writer.set_frame_dimension(w, h).map_err(codec)?;
        writer.set_frame_position(left, top).map_err(codec)?;
        pixels(&frame, area, options.has_alpha, &mut buffer);
        writer.write_image_data(&buffer).map_err(codec)?;
        before = frame;
        count += 1;
    }
    if count != options.frames {
        return Err(AnimationError::Frames.into());
    }
    writer.finish().map_err(codec)?;
    Ok(file)
}

/// Replaces the contents of a buffer by the pixels of a rectangle of an image: left, top, width, height.
fn pixels(image: &Image, [left, top, width, height]: [usize; 4], has_alpha: bool, buffer: &mut Vec<u8>) {
    let channels = if has_alpha { 4 } else { 3 };
    buffer.clear();
    for row in image.pixels().chunks(image.width()).skip(top).take(height) {
        for pixel in &row[left..left + width] {
            buffer.extend_from_slice(&pixel[..channels]);
        }
    }
}

/// Returns the smallest rectangle that contains all pixels that differ, as left, top, width, height; one pixel
/// if none does.
fn changed_area(before: &Image, after: &Image) -> [usize; 4] {
    let width = before.width();
    let (mut low, mut high) = ([usize::MAX; 2], [0; 2]);
    let rows = before.pixels().chunks(width).zip(after.pixels().chunks(width)).enumerate();
    for (y, (a, b)) in rows.filter(|(_, (a, b))| a != b) {
        let first = a.iter().zip(b).position(|(a, b)| a != b).unwrap_or(0);
        let last = a.iter().zip(b).rposition(|(a, b)| a != b).unwrap_or(0);
        low = [low[0].min(first), low[1].min(y)];
        high = [high[0].max(last), high[1].max(y)];
    }
    if low[0] == usize::MAX {
        return [0, 0, 1, 1];
    }
    [low[0], low[1], high[0] + 1 - low[0], high[1] + 1 - low[1]]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of a colour that moves to the right, on an empty background.
    fn frame(i: usize) -> Image {
        let pixel = |p: usize| {
            let (x, y) = (p % 24, p / 24);
            if (i..i + 5).contains(&x) && (3..8).contains(&y) { [200, 40 + i as u8, 10, 255] } else { [0; 4] }
        };
        Image::new(24, 12, (0..24 * 12).map(pixel).collect())
    }

    /// Decodes all frames as a viewer shows them.
    fn shown(file: &[u8]) -> Vec<Vec<u8>> {
        let mut reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().unwrap();
        let (width, channels) = (reader.info().width as usize, reader.info().bytes_per_pixel());
        let count = reader.info().animation_control().unwrap().num_frames;
        let mut canvas = vec![0u8; width * reader.info().height as usize * channels];
        let mut part = vec![0u8; reader.output_buffer_size().unwrap()];
        let mut all = Vec::new();
        for _ in 0..count {
            reader.next_frame(&mut part).unwrap();
            let about = *reader.info().frame_control().unwrap();
            let [x, y, w, h] =
                [about.x_offset, about.y_offset, about.width, about.height].map(|n| n as usize);
            for row in 0..h {
                let to = ((y + row) * width + x) * channels;
                let from = row * w * channels;
                canvas[to..to + w * channels].copy_from_slice(&part[from..from + w * channels]);
            }
            all.push(canvas.clone());
        }
        all
    }

    #[test]
    fn frames_come_back_with_and_without_opacity() {
        for has_alpha in [true, false] {
            let options = AnimationOptions { frames: 7, fps: 20, has_alpha };
            let order = [0, 1, 2, 2, 9, 3, 0];
            let file =
                encode_animation::<AnimationError>(options, order.iter().map(|i| Ok(frame(*i)))).unwrap();
            let seen = shown(&file);
            for (seen, i) in seen.iter().zip(order) {
                let channels = if has_alpha { 4 } else { 3 };
                let wanted: Vec<u8> = frame(i).pixels().iter().flat_map(|p| p[..channels].to_vec()).collect();
                assert!(*seen == wanted, "frame {i}");
            }
            assert_eq!(seen.len(), 7);
            // Programs without animations, such as our own reader, show the first frame.
            let first = crate::decode(&file).unwrap();
            assert_eq!((first.width(), first.height()), (24, 12));
        }
    }

    #[test]
    fn wrong_frames_are_errors() {
        let options = AnimationOptions { frames: 3, fps: 20, has_alpha: true };
        let of = |frames: Vec<Image>| encode_animation::<AnimationError>(options, frames.into_iter().map(Ok));
        assert!(of(vec![]).is_err() && of(vec![frame(0); 2]).is_err() && of(vec![frame(0); 4]).is_err());
        assert!(of(vec![frame(0), Image::filled(3, 3, [0; 4]), frame(0)]).is_err());
        assert!(of(vec![frame(0); 3]).is_ok());
    }
}
