//! SHA-256: what people compare a download with.
//!
//! Source: National Institute of Standards and Technology, "Secure Hash Standard", FIPS 180-4 (2015), section 6.2.

/// The first 64 primes: the constants are the first bits of what follows the point in their cube roots.
const fn primes() -> [u64; 64] {
    let (mut found, mut count, mut n) = ([0; 64], 0, 2u64);
    while count < 64 {
        let (mut k, mut is_prime) = (0, true);
        while k < count {
            is_prime &= n % found[k] != 0;
            k += 1;
        }
        if is_prime {
            found[count] = n;
            count += 1;
        }
        n += 1;
    }
    found
}

/// The first 32 bits after the point of a root of a prime: the largest r with r^power <= prime * 2^(32 * power).
const fn root_bits(prime: u64, power: u32) -> u32 {
    let wanted = (prime as u128) << (32 * power);
    let (mut low, mut high) = (0u128, 1u128 << 38);
    while high - low > 1 {
        let middle = (low + high) / 2;
        let mut product = middle;
        let mut k = 1;
        while k < power {
            product *= middle;
            k += 1;
        }
        if product <= wanted { low = middle } else { high = middle }
    }
    low as u32
}

const fn constants<const N: usize>(power: u32) -> [u32; N] {
    let (mut all, primes, mut k) = ([0; N], primes(), 0);
    while k < N {
        all[k] = root_bits(primes[k], power);
        k += 1;
    }
    all
}

const BEGIN: [u32; 8] = constants(2);
const ROUNDS: [u32; 64] = constants(3);

/// The sum, in hexadecimal digits.
pub(super) fn hex(bytes: &[u8]) -> String {
    let mut state = BEGIN;
    let (blocks, rest) = bytes.as_chunks::<64>();
    blocks.iter().for_each(|block| take(&mut state, block));
    let mut last = rest.to_vec();
    last.push(0x80);
    while last.len() % 64 != 56 {
        last.push(0);
    }
    last.extend((8 * bytes.len() as u64).to_be_bytes());
    last.as_chunks::<64>().0.iter().for_each(|block| take(&mut state, block));
    state.map(|word| format!("{word:08x}")).concat()
}

fn take(state: &mut [u32; 8], block: &[u8; 64]) {
    let mut words = [0u32; 64];
    for (word, bytes) in words.iter_mut().zip(block.as_chunks::<4>().0) {
        *word = u32::from_be_bytes(*bytes);
    }
    for t in 16..64 {
        let (x, y) = (words[t - 15], words[t - 2]);
        let small = x.rotate_right(7) ^ x.rotate_right(18) ^ (x >> 3);
        let large = y.rotate_right(17) ^ y.rotate_right(19) ^ (y >> 10);
        words[t] = words[t - 16].wrapping_add(small).wrapping_add(words[t - 7]).wrapping_add(large);
    }
    let [mut a, mut b, mut c, mut d, mut e, mut f, mut g, mut h] = *state;
    for (constant, word) in ROUNDS.iter().zip(words) {
        let mixed = e.rotate_right(6) ^ e.rotate_right(11) ^ e.rotate_right(25);
        let choice = (e & f) ^ (!e & g);
        let one = h.wrapping_add(mixed).wrapping_add(choice).wrapping_add(*constant).wrapping_add(word);
        let mixed = a.rotate_right(2) ^ a.rotate_right(13) ^ a.rotate_right(22);
        let two = mixed.wrapping_add((a & b) ^ (a & c) ^ (b & c));
        (h, g, f, e, d, c, b, a) = (g, f, e, d.wrapping_add(one), c, b, a, one.wrapping_add(two));
    }
    for (sum, part) in state.iter_mut().zip([a, b, c, d, e, f, g, h]) {
        *sum = sum.wrapping_add(part);
    }
}

#[cfg(test)]
mod tests {
    use super::hex;

    #[test]
    fn the_examples_of_the_standard() {
        assert_eq!(hex(b""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
        assert_eq!(hex(b"abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
        let two_blocks = b"abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq";
        assert_eq!(hex(two_blocks), "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
        let million = vec![b'a'; 1_000_000];
        assert_eq!(hex(&million), "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
    }
}
