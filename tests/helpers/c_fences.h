/* The fences of the runtime, where c_fences.c has them. */
void fence_release(void);
void fence_acquire(void);
