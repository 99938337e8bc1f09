"""Campaigns: a scenario's search flown over many drawn cases, and what became of them."""

from closeform.campaign.campaign import (
    Campaign,
    CampaignStatus,
    GatherCampaign,
    LockCampaign,
    SampledLocks,
    flown,
    study,
)
from closeform.campaign.draws import case_of, drawn
from closeform.campaign.shares import Estimate, Share

__all__ = [
    "Campaign",
    "CampaignStatus",
    "Estimate",
    "GatherCampaign",
    "LockCampaign",
    "SampledLocks",
    "Share",
    "case_of",
    "drawn",
    "flown",
    "study",
]
