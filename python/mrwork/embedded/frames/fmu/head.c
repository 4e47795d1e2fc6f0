/* Arguments that the standard names and this model has no use for. */
#ifdef __GNUC__
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif

#if defined(_WIN32) || defined(__CYGWIN__)
#define EXPORTED __declspec(dllexport)
#elif defined(__GNUC__)
#define EXPORTED __attribute__((visibility("default")))
#else
#define EXPORTED
#endif

#define TEXT(words) #words
#define TEXT_OF(macro) TEXT(macro)
#define PASTED(first, second) first##second
#define JOINED(first, second) PASTED(first, second)

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "NAME.h"
