% Answers of Octave's fuzzy-logic-toolkit to 200 random readings of each system in this folder.
% Run here: octave-cli --no-gui make_goldens.m   (about two minutes; see README.md)
1;
pkg load fuzzy-logic-toolkit

function fis = renamed(fis)
  % The toolkit has no `probor`; its own name for it is the algebraic sum.
  if strcmp(fis.orMethod, 'probor')
    fis.orMethod = 'algebraic_sum';
  end
end

function X = readings(fis, count)
  % Every other row is drawn to the low ends, where the liver's sets lie close together.
  ranges = vertcat(fis.input.range);
  powers = repmat([1; 3], count / 2, 1);
  X = ranges(:, 1)' + rand(count, rows(ranges)) .^ powers .* diff(ranges, 1, 2)';
end

function write_table(name, header, table)
  file = fopen(name, 'w');
  fprintf(file, '%s\n', strjoin(header, ','));
  form = [strjoin(repmat({'%.17g'}, 1, columns(table)), ','), '\n'];
  fprintf(file, form, table');
  fclose(file);
end

function golden(name)
  fis = renamed(readfis([name '.fis']));
  X = readings(fis, 200);
  header = {fis.input.name};
  if strcmp(fis.type, 'mamdani')
    write_table([name '.csv'], [header, {'centroid'}], [X, evalfis(X, fis, 101)]);
    return
  end
  by_sum = evalfis(X, setfis(fis, 'AggMethod', 'sum'));
  by_max = evalfis(X, setfis(fis, 'AggMethod', 'max'));
  write_table([name '.csv'], [header, {'sum', 'max'}], [X, by_sum, by_max]);
end

function functions()
  % The toolkit refuses vertical flanks and slopes of bells that are no whole numbers.
  sets = {
    'gaussmf', [1.5 4]
    'gauss2mf', [0.75 3 2 6]
    'gauss2mf', [1 5 3 5]
    'trimf', [1 4 9]
    'trapmf', [-2 1 4 7.5]
    'gbellmf', [1.5 2 5]
    'gbellmf', [2 1 3.3]
    'sigmf', [2 4]
    'sigmf', [-1.5 6]
    'dsigmf', [5 2 5 7]
    'dsigmf', [3 2 1.5 4]
    'psigmf', [2 3 -5 8]
    'zmf', [3 7]
    'smf', [1 8]
    'pimf', [1 4 5 10]
    'pimf', [2 5 5 6]
  };
  x = linspace(-1, 11, 49);
  file = fopen('functions.csv', 'w');
  fprintf(file, 'kind,parameters,x,membership\n');
  for k = 1:rows(sets)
    [kind, parameters] = sets{k, :};
    mu = evalmf(x, parameters, kind);
    for i = 1:numel(x)
      fprintf(file, '%s,%s,%.17g,%.17g\n', kind, num2str(parameters, '%.17g '), x(i), mu(i));
    end
  end
  fclose(file);
end

rand('twister', 247);
functions();
golden('mixed');
golden('mixed_sugeno');
golden('liver_sugeno');
golden('liver');
