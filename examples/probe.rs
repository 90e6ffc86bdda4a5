//! probe
use servotune::diagnose::{bench::Bench, run::runs, select::*};
use servotune::{recording::*, physics::library, lti::*};
use std::path::Path;
fn main(){
  for a in std::env::args().skip(1){
    let t0=std::time::Instant::now();
    let case=Case::read(Path::new(&a),&RecordSettings::default()).unwrap();
    let pf:PlantFile=servotune::document::read_toml(&case.plant).unwrap();
    let plant=Plant::try_from(pf).unwrap();
    let dt=case.records[0].1.sample_time_s;
    let mut b=Bench::new(&plant,runs(&case),dt,case.spindle_hz).unwrap();
    println!("==== {} levels {:?} t {:.2}",case.id,b.levels,t0.elapsed().as_secs_f64());
    let s=select(&mut b,library(),&SelectSettings::default(),|m| eprintln!("   .. {m} {:.2}",t0.elapsed().as_secs_f64()));
    let n=b.stack.total as f64;
    println!("  given {:.3} baseline {:.3} (sig {:.1}) conv {}",s.given/n,s.baseline.cost/n,s.baseline.excess_sigma(),s.baseline.refitted.converged);
    for st in &s.steps { for (i,m) in &st.tried { let c=&st.candidates[*i]; let l=m.chosen.last().unwrap();
       println!("    {:24} screen {:10.1} conc {:.4} lp {:.1}| cost/N {:.4} sig {:.1} inner {:.4?} str {:.5?} {}",c.effect.facts().name,c.gain,c.concealed,c.log_p_value(30),m.cost/n,m.excess_sigma(),l.setting.inner,l.setting.strengths,if m.refitted.converged {""} else {"NOCONV"}); }
       println!("    -> taken {:?}; best {} {:.1} lp {:.1}",st.taken,st.candidates[0].effect.facts().name,st.candidates[0].gain,st.candidates[0].log_p_value(30));}
    println!("  FOUND {:?} explained {:.4} sig {:.1} t {:.2}",s.model.chosen.iter().map(|c|(c.effect.facts().name,c.effect.parameters(&c.setting,&b.scene).iter().map(|p|format!("{}={:.5}",p.name,p.value)).collect::<Vec<_>>().join(" "))).collect::<Vec<_>>(),1.0-s.model.excess()/s.baseline.excess(),s.model.excess_sigma(),t0.elapsed().as_secs_f64());
    println!("  plant {:?} delay {:.4e}",s.model.refitted.plant.body,s.model.refitted.plant.delay_s);
  }
}
