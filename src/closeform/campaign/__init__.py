"""Monte Carlo studies of a scenario: sampling, execution of the cases, and statistics."""

from closeform.campaign.campaign import asked, flown, study
from closeform.campaign.draws import drawn
from closeform.campaign.gather_cases import GatherCampaign
from closeform.campaign.lock_cases import LockCampaign, SampledLocks
from closeform.campaign.one_case import case_of
from closeform.campaign.search_campaign import Campaign, CampaignStatus
from closeform.campaign.shares import Share

__all__ = [
    "Campaign",
    "CampaignStatus",
    "GatherCampaign",
    "LockCampaign",
    "SampledLocks",
    "Share",
    "asked",
    "case_of",
    "drawn",
    "flown",
    "study",
]
