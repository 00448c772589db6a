"""What a study hands back, for the rebuilt experiments of papers."""

from texture_benchmarks.study import BenchmarkOptions, BenchmarkResult

__all__ = ['BenchmarkOptions', 'BenchmarkResult']
