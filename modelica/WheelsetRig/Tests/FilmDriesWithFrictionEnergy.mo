within WheelsetRig.Tests;
model FilmDriesWithFrictionEnergy "Water on discs leaves with friction energy, not with time"
  parameter Real d(unit="1") = 0.54 "Share of friction lost at the start, 0.9*(0.30 - 0.12)/0.30";
  Effects.WaterFilm film(level=0.30, Fperp=30000.0, v=20.0, film=0.9);
  Effects.WaterFilm reverse(level=0.30, Fperp=30000.0, v=-20.0, film=0.9);
  Effects.WaterFilm light(level=0.30, Fperp=15000.0, v=20.0, film=0.9, E0=0.225e6);
  Effects.SingleDiscWaterFilm single(level=0.30, Fperp=30000.0, v=20.0, film=0.9);
  Units.Energy dry = 0.30*30000.0*20.0*time "Energy without water";
  // Of der(E) = level*Fperp*v*(1 - d*exp(-E/E0)), by y = exp(E/E0) - d.
  Real deficit(unit="1") = d/(d + (1.0 - d)*exp(dry/0.45e6)) "Share of friction that is lacking";
equation
  // 1e-6: the solver's tolerance of 1e-8 over the stop, enlarged by its length.
  assert(abs(film.mu - 0.30*(1.0 - deficit)) < 1e-6, "Deficit of three wet discs");
  assert(abs(film.mu - 0.30*(1.0 - d*exp(-film.E/0.45e6))) < 1e-12, "1/e of the film at E0");
  assert(abs(reverse.mu - film.mu) < 1e-6, "Direction");
  assert(abs(light.mu - film.mu) < 1e-6, "Half the power and half of E0");
  assert(abs(single.mu - 0.30*(1.0 - deficit/3.0)) < 1e-6, "Deficit of one wet disc");
  assert(abs(single.mu - single.lack - film.mu) < 1e-6, "It lacks what each of three does");
  assert(abs(film.lack) < 1e-12, "Discs that are all alike lack nothing of their mean");
  annotation (experiment(StopTime=10.0, Tolerance=1e-8));
end FilmDriesWithFrictionEnergy;
