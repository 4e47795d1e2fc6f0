/* Where a Cortex-M begins: the end of its memory, and the start of the library of C. */
extern void _start(void);
__attribute__((section(".vectors"), used)) static const void *const vectors[] = {(void *)0x20400000, (void *)_start};
