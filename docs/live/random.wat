;; Philox4x64-10 (J. Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC 2011) and the latents that
;; DeepMuon makes of it, as docs/random_numbers.md says. JavaScript has no fast 64-bit integers; this has.
(module
    (memory (export "memory") 1)

    ;; The upper 64 bits of a product.
    (func $upper (param $a i64) (param $b i64) (result i64)
        (local $a0 i64) (local $a1 i64) (local $b0 i64) (local $b1 i64) (local $middle i64)
        (local.set $a0 (i64.and (local.get $a) (i64.const 0xffffffff)))
        (local.set $a1 (i64.shr_u (local.get $a) (i64.const 32)))
        (local.set $b0 (i64.and (local.get $b) (i64.const 0xffffffff)))
        (local.set $b1 (i64.shr_u (local.get $b) (i64.const 32)))
        ;; (2^32 - 1)^2 + 2^32 - 1 < 2^64: none of these sums runs over.
        (local.set $middle
            (i64.add
                (i64.mul (local.get $a1) (local.get $b0))
                (i64.shr_u (i64.mul (local.get $a0) (local.get $b0)) (i64.const 32))))
        (i64.add
            (i64.add
                (i64.mul (local.get $a1) (local.get $b1))
                (i64.shr_u (local.get $middle) (i64.const 32)))
            (i64.shr_u
                (i64.add
                    (i64.mul (local.get $a0) (local.get $b1))
                    (i64.and (local.get $middle) (i64.const 0xffffffff)))
                (i64.const 32))))

    ;; The four words at the counter (counter, 0, 0, purpose) under the key (seed, stream).
    (func $philox (export "philox") (param $counter i64) (param $seed i64) (param $stream i64) (param $d i64)
        (result i64 i64 i64 i64)
        (local $a i64) (local $b i64) (local $c i64)
        (local $previous_a i64) (local $round i32)
        (local.set $a (local.get $counter))
        (loop $rounds
            (local.set $previous_a (local.get $a))
            (local.set $a
                (i64.xor
                    (i64.xor (call $upper (local.get $c) (i64.const 0xca5a826395121157)) (local.get $b))
                    (local.get $seed)))
            (local.set $b (i64.mul (local.get $c) (i64.const 0xca5a826395121157)))
            (local.set $c
                (i64.xor
                    (i64.xor (call $upper (local.get $previous_a) (i64.const 0xd2e7470ee14c6c93)) (local.get $d))
                    (local.get $stream)))
            (local.set $d (i64.mul (local.get $previous_a) (i64.const 0xd2e7470ee14c6c93)))
            (local.set $seed (i64.add (local.get $seed) (i64.const 0x9e3779b97f4a7c15)))
            (local.set $stream (i64.add (local.get $stream) (i64.const 0xbb67ae8584caa73b)))
            (local.set $round (i32.add (local.get $round) (i32.const 1)))
            (br_if $rounds (i32.lt_u (local.get $round) (i32.const 10))))
        (local.get $a) (local.get $b) (local.get $c) (local.get $d))

    ;; The latent of a half word: its upper 24 bits as a signed number s give (s + 1/2) / 2^23.
    (func $latent (param $half i32) (result f32)
        (f32.mul
            (f32.add
                (f32.convert_i32_s (i32.shr_s (local.get $half) (i32.const 8)))
                (f32.const 0.5))
            (f32.const 0x1p-23)))

    (func $write (param $address i32) (param $word i64)
        (f32.store (local.get $address) (call $latent (i32.wrap_i64 (local.get $word))))
        (f32.store offset=4
            (local.get $address)
            (call $latent (i32.wrap_i64 (i64.shr_u (local.get $word) (i64.const 32))))))

    ;; Fill the memory from address 0 with the latents of whole blocks, eight a block, from a block on.
    (func (export "fill_latents")
        (param $blocks i32) (param $seed i64) (param $stream i64) (param $purpose i64) (param $first_block i64)
        (local $address i32) (local $a i64) (local $b i64) (local $c i64) (local $d i64)
        (loop $next
            (local.set $first_block (i64.add (local.get $first_block) (i64.const 1))) ;; the first has counter 1
            (call $philox (local.get $first_block) (local.get $seed) (local.get $stream) (local.get $purpose))
            (local.set $d) (local.set $c) (local.set $b) (local.set $a)
            (call $write (local.get $address) (local.get $a))
            (call $write (i32.add (local.get $address) (i32.const 8)) (local.get $b))
            (call $write (i32.add (local.get $address) (i32.const 16)) (local.get $c))
            (call $write (i32.add (local.get $address) (i32.const 24)) (local.get $d))
            (local.set $address (i32.add (local.get $address) (i32.const 32)))
            (local.set $blocks (i32.sub (local.get $blocks) (i32.const 1)))
            (br_if $next (local.get $blocks)))))
