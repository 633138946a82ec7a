"""ASCII numbers, eight characters at a time: one 64-bit word each, the first character lowest.

Every function works on all bytes of a word at once (SIMD within a register; L. Lamport, "Multiple
byte processing with full-word instructions", 1975). It also gives the words that hold a character
which is no digit, so that no other text is read as a number.
"""

import numpy as np
from numpy.typing import NDArray

Words = NDArray[np.uint64]

WORD = np.dtype("<u8")
"""A word as written in a file: its first byte is the lowest on every machine."""


def _each(byte: int) -> np.uint64:
    """A word of eight equal bytes."""
    return np.uint64(byte * 0x0101010101010101)


_ZEROS, _ONES = _each(ord("0")), _each(1)
_LOW_NIBBLES, _HIGH_BITS = _each(0x0F), _each(0x80)
_OVER_NINE = _each(0x80 - 10)  # carries a byte over 9 into its high bit
_LETTER_GAP = np.uint64(ord("A") - ord("9") - 1)
_PAIRS, _FOURS = np.uint64(0x00FF00FF00FF00FF), np.uint64(0x0000FFFF0000FFFF)
# One multiplication brings 10 a + b of two neighbours into the upper one's place.
_TENS, _HUNDREDS, _MYRIADS = (np.uint64((10**n << 8 * n) + 1) for n in (1, 2, 4))
_4, _5, _6, _8, _9 = (np.uint64(n) for n in (4, 5, 6, 8, 9))
_16, _32 = np.uint64(16), np.uint64(32)


def keep(first: int, count: int) -> np.uint64:
    """A mask that keeps `count` of a word's bytes from the `first` one on."""
    return np.uint64(((1 << 8 * count) - 1) << 8 * first)


def zeros_outside(words: Words, kept: Words | np.uint64) -> None:
    """Put the digit 0 where a mask keeps nothing, in place."""
    words ^= _ZEROS
    words &= kept
    words ^= _ZEROS


def fill_blanks(words: Words, mask: np.uint64, first: np.uint64) -> Words:
    """Put the digit 0 for the spaces that pad numbers, in place; not 0 where they are no padding.

    Args:
        words: Characters, shape (n,).
        mask: Bytes that hold the number.
        first: Lowest bit of the first of them.

    """
    blank = ~(words >> _4) & _ONES & mask  # the bit that a space has not, and a digit has
    wrong = words & (blank * np.uint64(0x0F))
    wrong |= blank & ~((blank << _8) | first)  # a space behind a digit
    wrong |= blank >> np.uint64(56)  # no digit at all
    words |= blank << _4
    return wrong


def decimal(words: Words, kept: Words) -> tuple[Words, Words]:
    """Numbers of eight decimal digits, the highest first.

    Args:
        words: Characters, any shape; overwritten.
        kept: Masks of the bytes that hold digits; the others count as 0; broadcast to `words`.

    Returns:
        The numbers, in `words`' own memory, and words that are not 0 where a byte was no digit.

    """
    words ^= _ZEROS
    words &= kept
    wrong = words + _OVER_NINE
    wrong |= words  # a byte over 0x89 carries into its neighbour: its own high bit shows it
    wrong &= _HIGH_BITS
    words *= _TENS
    words >>= _8
    words &= _PAIRS
    words *= _HUNDREDS
    words >>= _16
    words &= _FOURS
    words *= _MYRIADS
    words >>= _32
    return words, wrong


def hexadecimal(words: Words) -> tuple[NDArray[np.uint8], Words]:
    """Bytes of pairs of hex digits of either case, the higher one first.

    Args:
        words: Characters, C-contiguous, shape (.., k).

    Returns:
        Bytes in the order of the characters, shape (.., 4 k), and words that are not 0 where a
        byte was no hex digit.

    """
    letters = words >> _6
    letters &= _ONES
    nibbles = letters * _9
    nibbles += words
    nibbles &= _LOW_NIBBLES
    # The nibbles are spelled anew: only a hex digit comes back as what it was.
    wrong = nibbles + _each(6)
    wrong >>= _4
    wrong &= _ONES
    wrong *= _LETTER_GAP
    wrong += nibbles
    wrong += _ZEROS
    wrong ^= words
    letters <<= _5  # the bit of the case
    np.invert(letters, out=letters)
    wrong &= letters
    upper = np.left_shift(nibbles, _4, out=letters)
    nibbles >>= _8
    nibbles |= upper
    return nibbles.view("<u2").astype(np.uint8), wrong
