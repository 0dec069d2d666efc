/* ProcessPrng for a Wine that has no bcryptprimitives.dll. For tests only: it is not part of what is given away. */
#include <windows.h>

#include <ntsecapi.h>

__declspec(dllexport) BOOL WINAPI ProcessPrng(BYTE* data, SIZE_T size) {
    const SIZE_T largest = 1 << 20;
    while (size > 0) {
        const ULONG part = (ULONG)(size < largest ? size : largest);
        if (!RtlGenRandom(data, part)) return FALSE;
        data += part;
        size -= part;
    }
    return TRUE;
}
