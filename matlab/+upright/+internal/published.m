function figures = published(agent, noise)
%PUBLISHED  Published mean numbers of trials to success, by source.
%   figures = upright.internal.published(agent, noise) returns a struct; NaN where a source has no
%   such figure. Report: its Table I (REINFORCE) or II (Q-learning), 20 runs of 60,000 steps.
%   Si_and_Wang_2001: direct NDP, 100 runs of 600,000 steps, from an exactly upright start.
%   He_2012: three networks, 100 runs.
%
%   Example:
%     upright.internal.published('q-learning', 'none')
    [~, names] = upright.noise_case();
    if strcmp(agent, 'reinforce')
        report = [35.65 34.6 49.6 32.5 44.1 40.6 106.9];
    else
        report = [42 NaN NaN NaN NaN NaN NaN];
    end
    si_and_wang = [6 8 14 32 54 164 193];
    he = [13.7 16.1 20.6 12.6 14.4 15 21.3];
    k = find(strcmp(noise, names));
    if isempty(k)
        figures = struct('Report', NaN, 'Si_and_Wang_2001', NaN, 'He_2012', NaN);
    else
        figures = struct( ...
            'Report', report(k), 'Si_and_Wang_2001', si_and_wang(k), 'He_2012', he(k));
    end
end
