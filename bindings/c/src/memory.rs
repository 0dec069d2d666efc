//! The buffers of the caller: every pointer that a caller passes is read or written here, through a view whose rows are
//! checked.

use std::ffi::{CStr, c_char};
use std::marker::PhantomData;

use crate::fault::Fault;

/// Number types for which all bit patterns are valid.
pub(crate) trait Number: Copy + Default {}
impl Number for f32 {}
impl Number for f64 {}
impl Number for u32 {}
impl Number for u8 {}

/// Rows of numbers in memory of the caller, which are only read: `width` numbers every `stride` bytes.
#[derive(Clone, Copy)]
pub(crate) struct Rows<'a, T> {
    first: *const T,
    count: usize,
    width: usize,
    stride: usize,
    of: PhantomData<&'a T>,
}

impl<'a, T: Number> Rows<'a, T> {
    /// Returns a view of a buffer; `None` for a null pointer.
    ///
    /// # Errors
    /// If the stride is smaller than a row, or if the rows do not fit into an address space.
    ///
    /// # Safety
    /// Unless `first` is null, the memory of `count` rows of `width` numbers, `stride` bytes apart, must be readable
    /// and not written by others during `'a`. It need not be aligned.
    pub(crate) unsafe fn new(
        name: &str,
        first: *const T,
        [count, width, stride]: [usize; 3],
    ) -> Result<Option<Self>, Fault> {
        if first.is_null() {
            return Ok(None);
        }
        check_extent::<T>(name, [count, width, stride])?;
        Ok(Some(Self { first, count, width, stride, of: PhantomData }))
    }

    /// Returns number `k` of row `i`.
    ///
    /// # Panics
    /// If there is no such row or number.
    #[inline(always)]
    pub(crate) fn get(&self, i: usize, k: usize) -> T {
        assert!(i < self.count && k < self.width, "row {i} of {}", self.count);
        // SAFETY: the number lies within the rows that were promised to `new`, and `check_extent` has seen that their
        // extent is no more than `isize::MAX` bytes; any bits are a valid number.
        unsafe { self.first.cast::<u8>().add(i * self.stride).cast::<T>().add(k).read_unaligned() }
    }

    /// Returns row `i`.
    ///
    /// # Panics
    /// If there is no such row, or if it is shorter.
    #[inline(always)]
    pub(crate) fn row<const N: usize>(&self, i: usize) -> [T; N] {
        std::array::from_fn(|k| self.get(i, k))
    }

    /// Returns all rows of `N` numbers.
    pub(crate) fn rows<const N: usize>(&self) -> Vec<[T; N]> {
        (0..self.count).map(|i| self.row(i)).collect()
    }

    /// Returns all numbers, row after row.
    pub(crate) fn numbers(&self) -> Vec<T> {
        (0..self.count).flat_map(|i| (0..self.width).map(move |k| self.get(i, k))).collect()
    }
}

/// Rows of numbers in memory of the caller, which are written.
pub(crate) struct RowsMut<'a, T> {
    first: *mut T,
    count: usize,
    width: usize,
    stride: usize,
    of: PhantomData<&'a mut T>,
}

impl<T: Number> RowsMut<'_, T> {
    /// Returns a view of a buffer.
    ///
    /// # Errors
    /// If the pointer is null although there are rows, or for the reasons of [`Rows::new`].
    ///
    /// # Safety
    /// Unless `first` is null, the memory of `count` rows must be writable and not used by others while the view
    /// exists. It need not be aligned.
    pub(crate) unsafe fn new(
        name: &str,
        first: *mut T,
        [count, width, stride]: [usize; 3],
    ) -> Result<Self, Fault> {
        check_extent::<T>(name, [count, width, stride])?;
        if first.is_null() && count > 0 {
            return Err(Fault::argument(format!("{name} is null")));
        }
        Ok(Self { first, count, width, stride, of: PhantomData })
    }

    /// Writes number `k` of row `i`.
    ///
    /// # Panics
    /// If there is no such row or number.
    #[inline(always)]
    pub(crate) fn set(&mut self, i: usize, k: usize, x: T) {
        assert!(i < self.count && k < self.width, "row {i} of {}", self.count);
        // SAFETY: as in `Rows::get`, with memory that may be written.
        unsafe { self.first.cast::<u8>().add(i * self.stride).cast::<T>().add(k).write_unaligned(x) };
    }

    /// Writes rows from the first one on.
    ///
    /// # Panics
    /// If there are more rows than in the view, or if they are longer.
    pub(crate) fn set_rows<const N: usize>(&mut self, rows: impl IntoIterator<Item = [T; N]>) {
        for (i, row) in rows.into_iter().enumerate() {
            for (k, x) in row.into_iter().enumerate() {
                self.set(i, k, x);
            }
        }
    }
}

fn check_extent<T>(name: &str, [count, width, stride]: [usize; 3]) -> Result<(), Fault> {
    let row = width.checked_mul(size_of::<T>());
    let Some(row) = row.filter(|row| *row <= stride || count < 2) else {
        return Err(Fault::argument(format!(
            "{name} has a stride of {stride} bytes, which is less than a row"
        )));
    };
    let extent = count.saturating_sub(1).checked_mul(stride).and_then(|before| before.checked_add(row));
    match extent.filter(|extent| isize::try_from(*extent).is_ok()) {
        Some(_) => Ok(()),
        None => Err(Fault::argument(format!("{name} has {count} rows, which do not fit into memory"))),
    }
}

/// Returns the numbers of a buffer without gaps.
///
/// # Errors
/// If it is null although there are numbers, or if they do not fit into an address space.
///
/// # Safety
/// As for [`Rows::new`].
pub(crate) unsafe fn numbers<T: Number>(name: &str, first: *const T, count: usize) -> Result<Vec<T>, Fault> {
    // SAFETY: promised by the caller.
    let rows = unsafe { Rows::new(name, first, [count, 1, size_of::<T>()]) }?;
    match rows {
        Some(rows) => Ok(rows.numbers()),
        None if count == 0 => Ok(Vec::new()),
        None => Err(Fault::argument(format!("{name} is null"))),
    }
}

/// Writes one number, unless the pointer is null.
///
/// # Safety
/// Unless it is null, the number must be writable.
pub(crate) unsafe fn set<T: Number>(to: *mut T, x: T) {
    if !to.is_null() {
        // SAFETY: promised by the caller.
        unsafe { to.write_unaligned(x) };
    }
}

/// Returns a text.
///
/// # Errors
/// If it is null or not UTF-8.
///
/// # Safety
/// Unless it is null, it must end with a zero byte, and not be written by others.
pub(crate) unsafe fn text(name: &str, text: *const c_char) -> Result<String, Fault> {
    if text.is_null() {
        return Err(Fault::argument(format!("{name} is null")));
    }
    // SAFETY: promised by the caller.
    let text = unsafe { CStr::from_ptr(text) };
    text.to_str().map(str::to_owned).map_err(|_| Fault::argument(format!("{name} is not UTF-8")))
}

/// A structure that a caller passes: only numbers and pointers, so that all bit patterns are valid, with its size as
/// the first field.
///
/// # Safety
/// The type must be `repr(C)`, valid for all bit patterns, and start with a `usize`.
pub(crate) unsafe trait CStructure: Copy {
    /// Its name in C.
    const NAME: &'static str;
}

/// Returns the size that a structure of the caller states.
///
/// # Errors
/// If it is null, or if its size is not set or larger than this library knows.
///
/// # Safety
/// Unless it is null, the size must be readable.
unsafe fn size_of_caller<T: CStructure>(from: *const T) -> Result<usize, Fault> {
    let (name, most) = (T::NAME, size_of::<T>());
    if from.is_null() {
        return Err(Fault::argument(format!("{name} is null")));
    }
    // SAFETY: the structure starts with its size, which the caller promises to be readable.
    let size = unsafe { from.cast::<usize>().read_unaligned() };
    if size < size_of::<usize>() || size > most {
        return Err(Fault::argument(format!(
            "{name} has the size {size}: set it to sizeof, which is at most {most} in this version"
        )));
    }
    Ok(size)
}

/// Returns a structure with the first `size` bytes from the caller and the others from `known`. A caller with an older
/// header has a smaller structure.
///
/// # Errors
/// If it is null, or if its size is not set or larger than this library knows.
///
/// # Safety
/// Unless it is null, its first `size` bytes must be readable.
pub(crate) unsafe fn sized<T: CStructure>(from: *const T, mut known: T) -> Result<T, Fault> {
    // SAFETY: promised by the caller.
    let size = unsafe { size_of_caller(from) }?;
    // SAFETY: `size` bytes are readable, and at most the size of `known`; all bit patterns are valid for the type.
    unsafe { std::ptr::copy_nonoverlapping(from.cast::<u8>(), (&raw mut known).cast::<u8>(), size) };
    Ok(known)
}

/// Writes as much of a structure as fits into the structure of the caller; the first field is not changed.
///
/// # Errors
/// As for [`sized`].
///
/// # Safety
/// Unless it is null, its size must be readable, and that many bytes writable.
pub(crate) unsafe fn set_sized<T: CStructure>(to: *mut T, value: &T) -> Result<(), Fault> {
    // SAFETY: promised by the caller.
    let size = unsafe { size_of_caller(to.cast_const()) }?;
    let skip = size_of::<usize>();
    // SAFETY: `size` bytes are writable, and at most the size of `value`; the size field of the caller is kept.
    unsafe {
        let from = std::ptr::from_ref(value).cast::<u8>().add(skip);
        std::ptr::copy_nonoverlapping(from, to.cast::<u8>().add(skip), size - skip);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_read_with_gaps_and_unaligned() {
        let bytes: Vec<u8> = (0..40).collect();
        let first = bytes[1..].as_ptr().cast::<f32>();
        // SAFETY: three rows of two numbers, 12 bytes apart, end at byte 1 + 24 + 8 of 40.
        let rows = unsafe { Rows::new("rows", first, [3, 2, 12]) }.unwrap().unwrap();
        let of = |at: usize| f32::from_ne_bytes(bytes[at..at + 4].try_into().unwrap());
        assert_eq!(rows.rows::<2>(), [[of(1), of(5)], [of(13), of(17)], [of(25), of(29)]]);
        assert_eq!(rows.numbers().len(), 6);
        assert!(std::panic::catch_unwind(|| rows.get(3, 0)).is_err());
    }

    #[test]
    fn impossible_extents_are_errors() {
        let one = [1f32; 4];
        let of = |shape| {
            // SAFETY: nothing is read, because the shapes are refused or have one row of four numbers.
            unsafe { Rows::new("rows", one.as_ptr(), shape) }.map(|rows| rows.is_some())
        };
        assert!(of([2, 3, 8]).is_err() && of([usize::MAX / 4, 3, 12]).is_err());
        assert!(of([usize::MAX, 3, 12]).is_err() && of([1, usize::MAX, 12]).is_err());
        assert_eq!(of([1, 4, 0]), Ok(true));
        // SAFETY: there is no memory.
        let none = unsafe { Rows::new("rows", std::ptr::null::<f32>(), [9, 3, 0]) };
        assert!(none.is_ok_and(|none| none.is_none()), "a null buffer has no stride");
    }

    #[test]
    fn writing_leaves_the_gaps() {
        let mut room = [9f32; 7];
        // SAFETY: two rows of three numbers, 16 bytes apart, are seven numbers.
        let mut rows = unsafe { RowsMut::new("rows", room.as_mut_ptr(), [2, 3, 16]) }.unwrap();
        rows.set_rows([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
        assert_eq!(room, [1.0, 2.0, 3.0, 9.0, 4.0, 5.0, 6.0]);
    }
}
