within SealFriction;
package Effects "Catalogue: what the nominal cylinder leaves out"
  annotation (Documentation(info="<html>
<p>What matters: 0.2 N of what changes its sign with the motion, at 10 mm/s and 7 bar, which is what
the friction of one seal scatters by from stroke to stroke. What does not change its sign may be
drift of a sensor, a thousandth of the range of 500 N or 10 bar: 0.5 N, over a stroke of 40 mm.</p>
</html>"));
end Effects;
