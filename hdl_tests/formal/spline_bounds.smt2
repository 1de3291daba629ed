; A sample of a cubic table lies between 12 times the least and 12 times the greatest of its four words, whatever the
; width of the words: Horner's rule over the reals, whose three products each take an error of at most a half from
; rounding. `unsat`: no words, no fraction and no errors bring a sample to 12 times the greatest word and 1, and a
; sample is a whole number. The least is the greatest of the negated words. The words are counted from the greatest, as
; all of them and the sample may move together: b3 to b1 are differences, and b0 takes a word twelve times.
(set-logic QF_NRA)
(declare-const c0 Real)
(declare-const c1 Real)
(declare-const c2 Real)
(declare-const c3 Real)
(declare-const v Real)  ; half the fraction of the segment
(declare-const first Real)
(declare-const second Real)
(declare-const third Real)
(define-fun b0 () Real (* 2 (+ c0 (* 4 c1) c2)))
(define-fun b1 () Real (* 12 (- c2 c0)))
(define-fun b2 () Real (* 24 (+ c0 (* (- 2) c1) c2)))
(define-fun b3 () Real (* 16 (+ (- c3 c0) (* 3 (- c1 c2)))))
(define-fun half () Real (/ 1 2))
(assert (and (<= c0 0) (<= c1 0) (<= c2 0) (<= c3 0)))
(assert (and (<= 0 v) (< v half)))
(assert (and (<= (- half) first half) (<= (- half) second half) (<= (- half) third half)))
(define-fun sample () Real (+ b0 third (* v (+ b1 second (* v (+ b2 first (* v b3)))))))
(assert (>= sample 1))
(check-sat)
