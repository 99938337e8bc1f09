"""Monte Carlo studies of a scenario: sampling, execution of the cases, and statistics."""

from closeform.campaign.campaign import evaluated, requested, study
from closeform.campaign.cases import CampaignStatus
from closeform.campaign.draws import drawn
from closeform.campaign.one_case import case_of
from closeform.campaign.search_cases import Campaign, GatherCampaign, LockCampaign, SampledLocks, Share

__all__ = [
    "Campaign",
    "CampaignStatus",
    "GatherCampaign",
    "LockCampaign",
    "SampledLocks",
    "Share",
    "case_of",
    "drawn",
    "evaluated",
    "requested",
    "study",
]
