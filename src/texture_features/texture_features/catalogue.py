"""The features that a recipe can name."""

from __future__ import annotations

from collections.abc import Mapping

from texture_features.feature import Feature
from texture_features.features.centred_log_ratio import CentredLogRatio
from texture_features.features.force import Force
from texture_features.features.friction import Friction
from texture_features.features.hjorth import Hjorth
from texture_features.features.log_bands import LogBands
from texture_features.features.log_difference_variance import LogDifferenceVariance
from texture_features.features.log_shares import LogShares
from texture_features.features.log_variance import LogVariance
from texture_features.features.low_fft_bins import LowFftBins
from texture_features.features.mean import ChannelMean
from texture_features.features.mean_log_bands import MeanLogBands
from texture_features.features.mean_spatial_bands import MeanSpatialBands
from texture_features.features.mean_statistics import ChannelMeanStatistics
from texture_features.features.moments import Moments
from texture_features.features.pacinian_power import PacinianPower
from texture_features.features.peak_to_median_power import PeakToMedianPower
from texture_features.features.power_autocorrelation import PowerAutocorrelation
from texture_features.features.relative_changes import RelativeChanges
from texture_features.features.short_time_fourier import ShortTimeFourier
from texture_features.features.slide_onset import SlideOnset
from texture_features.features.spatial_band_power import SpatialBandPower
from texture_features.features.spatial_bands import SpatialBands
from texture_features.features.spatial_variation import SpatialVariation
from texture_features.features.spectral_exponent import SpectralExponent
from texture_features.features.speed import Speed
from texture_features.features.temporal_variation import TemporalVariation

FEATURES: Mapping[str, type[Feature]] = {
    'log_bands': LogBands,  # Welch 1967
    'mean_log_bands': MeanLogBands,
    'low_fft_bins': LowFftBins,
    'hjorth': Hjorth,  # Hjorth 1970; Kaboli et al. 2015
    'short_time_fourier': ShortTimeFourier,
    'moments': Moments,
    'power_autocorrelation': PowerAutocorrelation,
    'mean': ChannelMean,
    'log_variance': LogVariance,
    'log_difference_variance': LogDifferenceVariance,
    'pacinian_power': PacinianPower,  # Bensmaia & Hollins 2005
    'spectral_exponent': SpectralExponent,  # Toscani & Metzger 2022
    'temporal_variation': TemporalVariation,  # Lieber & Bensmaia 2019
    'spatial_variation': SpatialVariation,  # Lieber & Bensmaia 2019
    'spatial_band_power': SpatialBandPower,
    'peak_to_median_power': PeakToMedianPower,
    'spatial_bands': SpatialBands,
    'mean_spatial_bands': MeanSpatialBands,
    'mean_statistics': ChannelMeanStatistics,
    'centred_log_ratio': CentredLogRatio,
    'log_shares': LogShares,  # Aitchison 1986, with signs
    'relative_changes': RelativeChanges,
    'speed': Speed,
    'force': Force,
    'friction': Friction,  # Roberge et al., future work
    'slide_onset': SlideOnset,
}
